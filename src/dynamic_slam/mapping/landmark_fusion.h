#pragma once

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/mapping/mapper_options.h"

namespace dynamic_slam {

struct FusionCount {
  int linked = 0;  // landmarks found in a keyframe that did not know of them
  int merged = 0;  // pairs of landmarks that were one
};

// Projects the keyframe's landmarks into its neighbours and theirs into it; links what is found, merges what
// is twice.
FusionCount FuseLandmarks(const Camera& camera, const MapperOptions& options, KeyframeId keyframe, Map* map);

}  // namespace dynamic_slam
