#pragma once

#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/mapping/mapper_options.h"

namespace dynamic_slam {

// Makes landmarks from keypoints of a keyframe and its neighbours that have none yet, by search along
// epipolar lines.
class LandmarkFactory {
 public:
  LandmarkFactory(const Camera& camera, const MapperOptions& options);

  // The new landmarks.
  std::vector<LandmarkId> Create(KeyframeId keyframe, Map* map) const;

 private:
  void CreateWithNeighbour(const Keyframe& keyframe, const Keyframe& neighbour, double median_depth, Map* map,
                           std::vector<LandmarkId>* created) const;

  Camera camera_;
  MapperOptions options_;
};

}  // namespace dynamic_slam
