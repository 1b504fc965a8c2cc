#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/features/features.h"
#include "dynamic_slam/features/keypoint_grid.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// One image as tracking sees it.
struct Frame {
  FrameId id;
  double timestamp_s = 0;
  FeatureSet features;
  // Where a rolling shutter read each keypoint, ideal px; in `features` they are where the middle row's time
  // has them, as far as the camera's motion is known. Empty: the same.
  std::vector<Eigen::Vector2f> read_px;
  KeypointGrid grid;
  std::vector<LandmarkId> landmarks;     // of each keypoint; not valid where there is none
  std::vector<Eigen::Vector3d> points;   // where that landmark was in the world when it was matched
  std::vector<Eigen::Vector3f> spreads;  // of that landmark (Landmark::spread), when it was matched
  std::vector<float> static_log_odds;    // of that landmark, when it was matched
  // P(at rest) of what each keypoint shows, before anything is known of its landmark; 0: not to be used.
  std::vector<float> static_probability;
  // Log of P(at rest) / P(moves) by how each keypoint moved since it was first seen (DynamicFilter).
  std::vector<float> motion_log_odds;
  Rigid3 cam_from_world;
  KeyframeId reference;  // the keyframe that shares most landmarks with it
  // Outlives changes of the map, which cam_from_world does not; lengths are in the reference's unit.
  Rigid3 cam_from_reference;
  double reference_unit = 1;  // Keyframe::unit of the reference, when the pose was found

  Eigen::Vector2d ReadPx(size_t keypoint) const {
    const Keypoint& k = features.keypoints[keypoint];
    return read_px.empty() ? Eigen::Vector2d(k.x, k.y) : read_px[keypoint].cast<double>();
  }

  float StaticProbability(size_t keypoint) const {  // 1 where nothing was said
    return static_probability.empty() ? 1.0f : static_probability[keypoint];
  }

  // Whether the keypoint is not to be used, or was seen to move: a box alone is not enough for that.
  bool MovesForSure(size_t keypoint) const {
    return StaticProbability(keypoint) <= 0 || (!motion_log_odds.empty() && motion_log_odds[keypoint] < 0);
  }

  void ClearLandmarks() {
    landmarks.assign(features.size(), LandmarkId());
    points.resize(features.size());
    spreads.assign(features.size(), Eigen::Vector3f::Zero());
    static_log_odds.assign(features.size(), 0.0f);
  }
};

// Where a camera was, relative to a keyframe: outlives whatever happens to the map.
struct AnchoredPose {
  double timestamp_s = 0;
  KeyframeId reference;
  Rigid3 cam_from_reference;  // lengths are in the reference's unit (Keyframe::unit)
};

// What a frame that is no keyframe sees of the map.
struct FrameView {
  struct Sighting {
    LandmarkId landmark;
    Eigen::Vector2f ideal_px;
    int32_t octave = 0;
    float static_probability = 1;
    Eigen::Vector2f raw_px = Eigen::Vector2f::Zero();  // where the image shows it
    float sigma_px = 0;  // standard deviation of ideal_px; 0: the scale of its octave
  };
  double timestamp_s = 0;
  PartId part;  // of the map
  Rigid3 cam_from_world;
  std::vector<Sighting> sightings;
};

// Where a keyframe sees a landmark, more exactly than its keypoint says.
struct AlignedKeypoint {
  Eigen::Vector2f ideal_px = Eigen::Vector2f::Zero();
  float sigma_px = 0;  // 0: nobody knows
};
using AlignedKeypoints = std::map<KeyframeId, std::vector<AlignedKeypoint>>;  // of each keypoint

class Keyframe;
class Map;

// The keyframe's image again, to be looked for in the map: without landmarks.
Frame FrameOf(const Keyframe& keyframe);

// Makes the frame a keyframe that sees the frame's landmarks, in a part of the map. These are not refreshed
// (Map::RefreshLandmark): local mapping does it, so that tracking need not.
KeyframeId InsertKeyframe(const Frame& frame, Map* map, PartId part = PartId(0));

}  // namespace dynamic_slam
