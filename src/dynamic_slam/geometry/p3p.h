#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// The at most four camera poses (cam_from_world) that see three points along three rays (any length, z > 0 in
// front); none when the points are collinear. Persson and Nordberg, "Lambda Twist", ECCV 2018.
std::vector<Rigid3> SolveP3p(const std::array<Eigen::Vector3d, 3>& points_in_world,
                             const std::array<Eigen::Vector3d, 3>& rays);

}  // namespace dynamic_slam
