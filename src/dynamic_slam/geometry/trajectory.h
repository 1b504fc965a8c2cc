#pragma once

#include <vector>

#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

struct StampedPose {
  double timestamp_s = 0;
  Rigid3 world_from_cam;
};

// Poses in the order of time.
using Trajectory = std::vector<StampedPose>;

}  // namespace dynamic_slam
