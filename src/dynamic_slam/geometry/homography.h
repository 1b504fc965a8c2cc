#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// The homography, second ~ H * first, of four pairs of homogeneous points; nothing when three are collinear.
std::optional<Eigen::Matrix3d> HomographyFromFour(const std::array<Eigen::Vector3d, 4>& first,
                                                  const std::array<Eigen::Vector3d, 4>& second);

// The same in the least squares sense from four or more points (x, y): the normalised direct linear transform
// (Hartley and Zisserman, algorithm 4.2).
std::optional<Eigen::Matrix3d> FitHomography(std::span<const Eigen::Vector2d> first,
                                             std::span<const Eigen::Vector2d> second);

// The poses second_from_first that a homography between rays (x, y, 1) may come from, with |translation| = 1:
// four, or one with translation zero when H is a rotation (to `rotation_tolerance` in its singular values).
// Ma, Soatto, Kosecka and Sastry, "An Invitation to 3-D Vision", 2004, section 5.3.3.
std::vector<Rigid3> PosesFromHomography(const Eigen::Matrix3d& second_H_first,
                                        double rotation_tolerance = 1e-6);

// The other motion that takes the plane nearest to the points where `second_from_first` takes it, with
// |translation| = 1 and either sign: two views of a scene close to a plane fit both. Nothing when there is
// none, as when the plane is approached head-on.
std::optional<Rigid3> TwinMotion(const Rigid3& second_from_first,
                                 std::span<const Eigen::Vector3d> points_in_first);

}  // namespace dynamic_slam
