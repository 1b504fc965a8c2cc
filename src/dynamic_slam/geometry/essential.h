#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// Essential matrices E with second_ray' * E * first_ray = 0 for five pairs of rays (x, y, 1): at most ten, of
// unit norm. Works for points on a plane too. Nister, "An Efficient Solution to the Five-Point Relative Pose
// Problem", PAMI 2004.
std::vector<Eigen::Matrix3d> FivePointEssential(const std::array<Eigen::Vector3d, 5>& first_rays,
                                                const std::array<Eigen::Vector3d, 5>& second_rays);

inline Eigen::Matrix3d EssentialFromPose(const Rigid3& second_from_first) {
  return Skew(second_from_first.translation) * second_from_first.Matrix();
}

// The four poses, with |translation| = 1, that have this essential matrix.
std::array<Rigid3, 4> PosesFromEssential(const Eigen::Matrix3d& E);

// Match coordinates relative to the principal point, in px.
struct PixelPair {
  double x1, y1, x2, y2;
};

// Minimises the Sampson errors in px over rotation and direction of translation (5 degrees of freedom,
// Levenberg-Marquardt) with Tukey's weights, which vanish at `cut_px`. Keeps |translation| = 1.
Rigid3 RefineRelativePose(std::span<const PixelPair> pairs, double fx, double fy, double cut_px,
                          int iterations, const Rigid3& second_from_first);

}  // namespace dynamic_slam
