#pragma once

#include "dynamic_slam/map/map.h"
#include "dynamic_slam/map_view.h"

namespace dynamic_slam {

// What the map holds. camera: of the prepared images.
MapView ContentsOf(const Camera& camera, const Map& map);

}  // namespace dynamic_slam
