#include "dynamic_slam/map/frame.h"

#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

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
