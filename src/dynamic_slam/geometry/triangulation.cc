#include "dynamic_slam/geometry/triangulation.h"

#include <cmath>
#include <limits>

#include <Eigen/Geometry>

namespace dynamic_slam {

TwoViewTriangulator::TwoViewTriangulator(const Rigid3& second_from_first)
    : second_R_first_(second_from_first.Matrix()),
      second_t_first_(second_from_first.translation),
      first_E_second_((Skew(second_t_first_) * second_R_first_).transpose()) {}

std::optional<Eigen::Vector3d> TwoViewTriangulator::Triangulate(const Eigen::Vector3d& first_ray,
                                                                const Eigen::Vector3d& second_ray) const {
  // Lindstrom 2010, listing 3, in its notation: x in the first image, x' (here y) in the second.
  const Eigen::Matrix3d& E = first_E_second_;
  const Eigen::Matrix2d E22 = E.topLeftCorner<2, 2>();
  Eigen::Vector2d n = (E * second_ray).head<2>();
  Eigen::Vector2d n_y = (E.transpose() * first_ray).head<2>();
  const double a = n.dot(E22 * n_y);
  const double b = 0.5 * (n.squaredNorm() + n_y.squaredNorm());
  const double c = first_ray.dot(E * second_ray);
  const double d = std::sqrt(std::max(b * b - a * c, 0.0));
  if (!(b + d > 0)) return std::nullopt;  // no baseline, or both points at the epipoles
  double lambda = c / (b + d);
  const Eigen::Vector2d step = lambda * n;
  const Eigen::Vector2d step_y = lambda * n_y;
  n -= E22 * step_y;
  n_y -= E22.transpose() * step;
  const double norm2 = n.squaredNorm() + n_y.squaredNorm();
  if (!(norm2 > 0)) return std::nullopt;
  lambda *= 2.0 * d / norm2;
  Eigen::Vector3d x = first_ray, y = second_ray;
  x.head<2>() -= lambda * n;
  y.head<2>() -= lambda * n_y;

  // The corrected rays meet: depth_x * R x + t = depth_y * y.
  const Eigen::Vector3d rotated = second_R_first_ * x;
  const Eigen::Vector3d normal = y.cross(rotated);
  const double normal2 = normal.squaredNorm();
  if (!(normal2 > 1e-18 * y.squaredNorm() * rotated.squaredNorm())) return std::nullopt;
  const double depth_x = normal.dot(second_t_first_.cross(y)) / normal2;
  const double depth_y = normal.dot(second_t_first_.cross(rotated)) / normal2;
  if (!(depth_x > 0 && depth_y > 0)) return std::nullopt;
  return depth_x * x;
}

std::optional<Eigen::Vector3d> TriangulateInWorld(const Rigid3& first_from_world,
                                                  const Eigen::Vector3d& first_ray,
                                                  const Rigid3& second_from_world,
                                                  const Eigen::Vector3d& second_ray) {
  const Rigid3 world_from_first = first_from_world.Inverse();
  const auto x_in_first =
      TwoViewTriangulator(second_from_world * world_from_first).Triangulate(first_ray, second_ray);
  if (!x_in_first) return std::nullopt;
  return world_from_first * *x_in_first;
}

double ParallaxAngle(const Eigen::Vector3d& ray, const Eigen::Vector3d& other_ray) {
  return std::atan2(ray.cross(other_ray).norm(), ray.dot(other_ray));
}

double SquaredReprojectionError(const Camera& camera, const Rigid3& cam_from_world,
                                const Eigen::Vector3d& x_in_world, const Eigen::Vector2d& ideal_px) {
  const Eigen::Vector3d x_in_cam = cam_from_world * x_in_world;
  if (!(x_in_cam.z() > 0)) return std::numeric_limits<double>::infinity();
  return (camera.Project(x_in_cam) - ideal_px).squaredNorm();
}

}  // namespace dynamic_slam
