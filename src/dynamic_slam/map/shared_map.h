#pragma once

#include "dynamic_slam/base/guarded.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// The map as the stages share it: locked for a moment at a time, by Read() and Write().
using SharedMap = Guarded<Map>;

}  // namespace dynamic_slam
