#pragma once

#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/mapping/mapper_options.h"

namespace dynamic_slam {

// A landmark that two keyframes could share.
struct LandmarkProposal {
  KeyframeId first, second;
  uint32_t first_keypoint = 0, second_keypoint = 0;
  Eigen::Vector3d position;  // in world
};

// Finds landmarks for keypoints of a keyframe and its neighbours that have none yet, by search along epipolar
// lines.
class LandmarkFactory {
 public:
  LandmarkFactory(const Camera& camera, const MapperOptions& options);

  // The keyframes with which the keyframe shares most, and which are far enough away from it.
  std::vector<KeyframeId> Neighbours(const Map& map, KeyframeId keyframe) const;

  // May propose several landmarks for one keypoint of the neighbour.
  std::vector<LandmarkProposal> Propose(const Map& map, KeyframeId keyframe, KeyframeId neighbour) const;

  // Makes those whose keypoints are still free; returns them.
  static std::vector<LandmarkId> Add(const std::vector<LandmarkProposal>& proposals, Map* map);

 private:
  Camera camera_;
  MapperOptions options_;
};

}  // namespace dynamic_slam
