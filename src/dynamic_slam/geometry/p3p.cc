#include "dynamic_slam/geometry/p3p.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "dynamic_slam/geometry/polynomial.h"

namespace dynamic_slam {
namespace {

// |L_i y_i - L_j y_j|^2 as a quadratic form in the distances L = (L_1, L_2, L_3).
Eigen::Matrix3d DistanceForm(int i, int j, double cosine) {
  Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
  m(i, i) = m(j, j) = 1;
  m(i, j) = m(j, i) = -cosine;
  return m;
}

// Newton's method on the three distance equations; three steps reach double precision.
void PolishDistances(const Eigen::Vector3d& squared, const Eigen::Vector3d& cosines,
                     Eigen::Vector3d* distances) {
  static constexpr int kPairs[3][2] = {{0, 1}, {0, 2}, {1, 2}};
  for (int iteration = 0; iteration < 3; ++iteration) {
    Eigen::Vector3d residual;
    Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const int i = kPairs[k][0], j = kPairs[k][1];
      const double a = (*distances)[i], b = (*distances)[j];
      residual[k] = a * a + b * b - 2 * cosines[k] * a * b - squared[k];
      J(k, i) = 2 * (a - cosines[k] * b);
      J(k, j) = 2 * (b - cosines[k] * a);
    }
    const Eigen::Vector3d next = *distances - J.inverse() * residual;
    if (!next.allFinite()) return;
    *distances = next;
  }
}

}  // namespace

std::vector<Rigid3> SolveP3p(const std::array<Eigen::Vector3d, 3>& points_in_world,
                             const std::array<Eigen::Vector3d, 3>& rays) {
  std::vector<Rigid3> poses;
  const Eigen::Vector3d y1 = rays[0].normalized(), y2 = rays[1].normalized(), y3 = rays[2].normalized();
  const Eigen::Vector3d d12 = points_in_world[0] - points_in_world[1];
  const Eigen::Vector3d d13 = points_in_world[0] - points_in_world[2];
  const Eigen::Vector3d d23 = points_in_world[1] - points_in_world[2];
  const double a12 = d12.squaredNorm(), a13 = d13.squaredNorm(), a23 = d23.squaredNorm();
  const Eigen::Vector3d normal = d12.cross(d13);
  if (!(normal.squaredNorm() > 1e-12 * a12 * a13)) return poses;
  const Eigen::Vector3d cosines(y1.dot(y2), y1.dot(y3), y2.dot(y3));

  // Two homogeneous conics in the distances; the cubic gives a member of their pencil that is a pair of
  // lines.
  const Eigen::Matrix3d M23 = DistanceForm(1, 2, cosines[2]);
  const double scale = 1.0 / a23;  // makes the squared lengths pure numbers
  const Eigen::Matrix3d D1 = DistanceForm(0, 1, cosines[0]) - a12 * scale * M23;
  const Eigen::Matrix3d D2 = DistanceForm(0, 2, cosines[1]) - a13 * scale * M23;
  const auto mixed = [](const Eigen::Matrix3d& a,
                        const Eigen::Matrix3d& b) {  // sum of det(a, .., b in one column)
    return a.col(0).cross(a.col(1)).dot(b.col(2)) + a.col(0).cross(b.col(1)).dot(a.col(2)) +
           b.col(0).cross(a.col(1)).dot(a.col(2));
  };
  const std::array<double, 4> cubic = {D1.determinant(), mixed(D1, D2), mixed(D2, D1), D2.determinant()};
  std::array<double, 6> roots;
  const int root_count = RealRoots<3>(cubic, &roots);
  if (root_count == 0) return poses;
  double gamma = roots[0], best_slope = -1;
  for (int i = 0; i < root_count; ++i) {
    double value, slope;
    EvaluatePolynomial(cubic.data(), 3, roots[i], &value, &slope);
    const double relative = std::abs(slope) / (1.0 + roots[i] * roots[i]);
    if (relative > best_slope) {
      best_slope = relative;
      gamma = roots[i];
    }
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.compute(D1 + gamma * D2);
  const Eigen::Vector3d values = eigen.eigenvalues();  // ascending: negative, about zero, positive
  if (!(values[0] < 0 && values[2] > 0)) return poses;
  const Eigen::Vector3d root_negative = eigen.eigenvectors().col(0) * std::sqrt(-values[0]);
  const Eigen::Vector3d root_positive = eigen.eigenvectors().col(2) * std::sqrt(values[2]);

  for (const double sign : {1.0, -1.0}) {
    const Eigen::Vector3d line = root_positive + sign * root_negative;
    if (std::abs(line[0]) < 1e-12 * line.norm()) continue;
    // L = L2 (w0 + w1 tau, 1, tau) on this line; a quadratic in tau on the conic that tells most.
    const Eigen::Vector3d at0(-line[1] / line[0], 1, 0), slope(-line[2] / line[0], 0, 1);
    Eigen::Vector3d q(0, 0, 0);
    for (const Eigen::Matrix3d* conic : {&D1, &D2}) {
      const Eigen::Vector3d candidate(slope.dot(*conic * slope), 2 * at0.dot(*conic * slope),
                                      at0.dot(*conic * at0));
      if (candidate.squaredNorm() > q.squaredNorm()) q = candidate;
    }
    const double discriminant = q[1] * q[1] - 4 * q[0] * q[2];
    if (discriminant < 0) continue;
    const double h = -0.5 * (q[1] + std::copysign(std::sqrt(discriminant), q[1]));
    for (const double tau : {h / q[0], q[2] / h}) {
      if (!std::isfinite(tau) || tau <= 0) continue;
      const double l2_squared = a23 / (1.0 + tau * (tau - 2.0 * cosines[2]));
      if (!(l2_squared > 0)) continue;
      Eigen::Vector3d distances = std::sqrt(l2_squared) * (at0 + tau * slope);
      if (distances[0] <= 0) continue;
      PolishDistances(Eigen::Vector3d(a12, a13, a23), cosines, &distances);
      if (!(distances.minCoeff() > 0)) continue;
      const Eigen::Vector3d x1 = distances[0] * y1, e12 = x1 - distances[1] * y2,
                            e13 = x1 - distances[2] * y3;
      Eigen::Matrix3d in_cam, in_world;
      in_cam << e12, e13, e12.cross(e13);
      in_world << d12, d13, normal;
      const Rigid3 rotation_only(Eigen::Matrix3d(in_cam * in_world.inverse()), Eigen::Vector3d::Zero());
      const Rigid3 pose(rotation_only.rotation, x1 - rotation_only.rotation * points_in_world[0]);
      if (pose.IsFinite()) poses.push_back(pose);
    }
  }
  return poses;
}

}  // namespace dynamic_slam
