#pragma once

#include <optional>

#include <Eigen/Core>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// Triangulates points seen from two poses. Make one for a pair of views, then call it for each match.
//
// Rays are Camera::Unproject results: (x, y, 1). The answer minimises the sum of squared reprojection errors
// in both (normalised) images: Lindstrom, "Triangulation Made Easy", CVPR 2010 (niter2), which stays accurate
// when the rays are almost parallel, where the midpoint and the linear methods are biased.
class TwoViewTriangulator {
 public:
  explicit TwoViewTriangulator(const Rigid3& second_from_first);

  // The point in the first camera's frame; nothing when the rays are parallel (to 1e-9 rad, baseline zero
  // included) or the point lies behind either camera.
  std::optional<Eigen::Vector3d> Triangulate(const Eigen::Vector3d& first_ray,
                                             const Eigen::Vector3d& second_ray) const;

 private:
  Eigen::Matrix3d second_R_first_;
  Eigen::Vector3d second_t_first_;
  Eigen::Matrix3d first_E_second_;  // first_ray' * E * second_ray = 0
};

// The same for one point and poses relative to the world; the point in the world.
std::optional<Eigen::Vector3d> TriangulateInWorld(const Rigid3& first_from_world,
                                                  const Eigen::Vector3d& first_ray,
                                                  const Rigid3& second_from_world,
                                                  const Eigen::Vector3d& second_ray);

// Angle in rad, in [0, pi], between two rays in one frame (for a point: point - centre_of_camera); accurate
// for tiny angles, where acos is not.
double ParallaxAngle(const Eigen::Vector3d& ray, const Eigen::Vector3d& other_ray);

// Squared distance in px^2 between the projection of a point and where it was seen; infinite behind the
// camera.
double SquaredReprojectionError(const Camera& camera, const Rigid3& cam_from_world,
                                const Eigen::Vector3d& x_in_world, const Eigen::Vector2d& ideal_px);

}  // namespace dynamic_slam
