#include "dynamic_slam/geometry/rigid3.h"

#include <cmath>

namespace dynamic_slam {

Eigen::Quaterniond ExpSo3(const Eigen::Vector3d& rotation_vector) {
  const double angle_squared = rotation_vector.squaredNorm();
  const double angle = std::sqrt(angle_squared);
  // sin(x/2)/x by its series near zero, where the quotient loses its digits.
  const double factor = angle < 1e-4 ? 0.5 - angle_squared / 48.0 : std::sin(0.5 * angle) / angle;
  const double w = angle < 1e-4 ? 1.0 - angle_squared / 8.0 : std::cos(0.5 * angle);
  return Eigen::Quaterniond(w, factor * rotation_vector.x(), factor * rotation_vector.y(),
                            factor * rotation_vector.z())
      .normalized();
}

Eigen::Vector3d LogSo3(const Eigen::Quaterniond& rotation) {
  Eigen::Quaterniond q = rotation;
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double sine = q.vec().norm();
  const double factor = sine < 1e-8 ? 2.0 / q.w() : 2.0 * std::atan2(sine, q.w()) / sine;
  return factor * q.vec();
}

double RotationAngle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return LogSo3(a.conjugate() * b).norm();
}

}  // namespace dynamic_slam
