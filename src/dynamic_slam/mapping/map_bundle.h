#pragma once

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/mapping/mapper_options.h"
#include "dynamic_slam/optimize/bundle_adjustment.h"

namespace dynamic_slam {

// Bundle adjustment of the keyframe, its best neighbours and all they see; others that see it too stay fixed.
// Links that do not fit are broken.
BundleSummary AdjustLocal(const Camera& camera, const MapperOptions& options, KeyframeId keyframe, Map* map);

// The same of the whole map, the oldest keyframe fixed.
BundleSummary AdjustAll(const Camera& camera, const MapperOptions& options, Map* map);

}  // namespace dynamic_slam
