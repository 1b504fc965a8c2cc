#pragma once

#include <cstdint>

#include "dynamic_slam/base/export.h"

namespace dynamic_slam {

enum class TrackingState : uint8_t {
  kInitialising,  // there is no map yet, or the camera was lost for long: a start is looked for
  kTracking,
  kLost,  // there is a map, and no pose in it
};

DYNAMIC_SLAM_API const char* Name(TrackingState state);

}  // namespace dynamic_slam
