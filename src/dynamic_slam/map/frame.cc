#include "dynamic_slam/map/frame.h"

#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

Frame FrameOf(const Keyframe& keyframe) {
  Frame frame;
  frame.id = keyframe.frame_id();
  frame.timestamp_s = keyframe.timestamp_s();
  frame.features = keyframe.features();
  frame.grid = keyframe.grid();
  frame.static_probability = keyframe.static_probability();
  frame.cam_from_world = keyframe.cam_from_world();
  frame.ClearLandmarks();
  return frame;
}

KeyframeId InsertKeyframe(const Frame& frame, Map* map, PartId part) {
  const KeyframeId id = map->AddKeyframe(frame.id, frame.timestamp_s, frame.cam_from_world, frame.features,
                                         frame.grid, frame.static_probability, part)
                            .id();
  for (uint32_t keypoint = 0; keypoint < frame.landmarks.size(); ++keypoint) {
    const LandmarkId landmark = map->Resolve(frame.landmarks[keypoint]);
    if (!landmark.IsValid() || map->landmarks().At(landmark).IsSeenBy(id)) continue;
    map->Link(id, keypoint, landmark);
  }
  return id;
}

}  // namespace dynamic_slam
