#pragma once

#include <optional>
#include <vector>

#include "dynamic_slam/geometry/sim3.h"

namespace dynamic_slam {

// The similarity (or, without scale, the rigid transform with scale 1) that minimises
// sum |target[i] - target_from_source * source[i]|^2, in closed form (Umeyama 1991).
//
// Nothing when the rotation is not determined: fewer than 3 points, or all of them on one line.
// The vectors must be of equal size.
std::optional<Sim3> AlignUmeyama(const std::vector<Eigen::Vector3d>& source,
                                 const std::vector<Eigen::Vector3d>& target, bool with_scale);

}  // namespace dynamic_slam
