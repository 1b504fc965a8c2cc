#pragma once

#include <utility>

#include "dynamic_slam/geometry/trajectory.h"

namespace dynamic_slam {

// How rough two reconstructions of a path are where they differ: how far the camera's centre departs, from
// one pose to the next, from going straight on as fast as before. In the mean over the poses that both have
// and that follow each other, each of the weight by which the two differ there when half of them lie as well
// on each other as they can, in the unit of the first. What carries a camera has mass, so the rougher one
// errs by more. Nothing, 0 and 0, where they do not differ or cannot be laid on each other.
std::pair<double, double> RoughnessWhereTheyDiffer(const Trajectory& a, const Trajectory& b);

}  // namespace dynamic_slam
