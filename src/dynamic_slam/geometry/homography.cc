#include "dynamic_slam/geometry/homography.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

// The matrix that maps the unit vectors and (1, 1, 1) to four points.
std::optional<Eigen::Matrix3d> ProjectiveBasis(const std::array<Eigen::Vector3d, 4>& p) {
  Eigen::Matrix3d m;
  m << p[0], p[1], p[2];
  const double scale = p[0].norm() * p[1].norm() * p[2].norm();
  if (!(std::abs(m.determinant()) > 1e-9 * scale)) return std::nullopt;
  const Eigen::Vector3d weights = m.inverse() * p[3];
  if (!(weights.cwiseAbs().minCoeff() > 1e-6 * weights.cwiseAbs().maxCoeff())) return std::nullopt;
  return m * weights.asDiagonal();
}

// Moves the centroid to 0 and the mean distance from it to sqrt(2).
Eigen::Matrix3d Normalisation(std::span<const Eigen::Vector2d> points) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& p : points) mean += p;
  mean /= static_cast<double>(points.size());
  double distance = 0;
  for (const auto& p : points) distance += (p - mean).norm();
  const double scale = std::sqrt(2.0) * static_cast<double>(points.size()) / std::max(distance, 1e-300);
  Eigen::Matrix3d m;
  m << scale, 0, -scale * mean.x(), 0, scale, -scale * mean.y(), 0, 0, 1;
  return m;
}

}  // namespace

std::optional<Eigen::Matrix3d> HomographyFromFour(const std::array<Eigen::Vector3d, 4>& first,
                                                  const std::array<Eigen::Vector3d, 4>& second) {
  const auto from = ProjectiveBasis(first), to = ProjectiveBasis(second);
  if (!from || !to) return std::nullopt;
  const Eigen::Matrix3d H = *to * from->inverse();
  if (!H.allFinite()) return std::nullopt;
  return H / H.norm();
}

std::optional<Eigen::Matrix3d> FitHomography(std::span<const Eigen::Vector2d> first,
                                             std::span<const Eigen::Vector2d> second) {
  DS_CHECK(first.size() == second.size(), "{} and {} points", first.size(), second.size());
  if (first.size() < 4) return std::nullopt;
  const Eigen::Matrix3d normalise_first = Normalisation(first), normalise_second = Normalisation(second);
  Eigen::Matrix<double, 9, 9> A = Eigen::Matrix<double, 9, 9>::Zero();
  for (size_t i = 0; i < first.size(); ++i) {
    const Eigen::Vector3d p = normalise_first * first[i].homogeneous();
    const Eigen::Vector3d q = normalise_second * second[i].homogeneous();
    // Rows (-p, 0, u p) and (0, -p, v p) of the design matrix, added as blocks of p p'.
    const Eigen::Matrix3d pp = p * p.transpose();
    A.block<3, 3>(0, 0) += pp;
    A.block<3, 3>(0, 6) -= q.x() * pp;
    A.block<3, 3>(3, 6) -= q.y() * pp;
    A.block<3, 3>(6, 6) += q.head<2>().squaredNorm() * pp;
  }
  A.block<3, 3>(3, 3) = A.block<3, 3>(0, 0);
  A.block<3, 3>(6, 0) = A.block<3, 3>(0, 6);
  A.block<3, 3>(6, 3) = A.block<3, 3>(3, 6);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(A);
  const Eigen::Matrix<double, 9, 1> flat = eigen.eigenvectors().col(0);
  const Eigen::Matrix3d normalised = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>::Map(flat.data());
  const Eigen::Matrix3d H = normalise_second.inverse() * normalised * normalise_first;
  if (!H.allFinite() || H.norm() == 0) return std::nullopt;
  return H / H.norm();
}

std::vector<Rigid3> PosesFromHomography(const Eigen::Matrix3d& second_H_first, double rotation_tolerance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(second_H_first.transpose() * second_H_first);
  const Eigen::Vector3d singular = eigen.eigenvalues().reverse().cwiseMax(0.0).cwiseSqrt();  // descending
  const Eigen::Vector3d s = singular / singular[1];
  if (!s.allFinite()) return {};
  Eigen::Matrix3d H = second_H_first / singular[1];
  if (H.determinant() < 0) H = -H;
  if (s[0] - s[2] < rotation_tolerance) return {Rigid3(H, Eigen::Vector3d::Zero())};
  Eigen::Matrix3d V = eigen.eigenvectors().rowwise().reverse();
  if (V.determinant() < 0) V = -V;

  // H preserves the length of v2 and of both u (hence all vectors in the planes they span).
  const double p = std::sqrt(std::max(1.0 - s[2] * s[2], 0.0)),
               q = std::sqrt(std::max(s[0] * s[0] - 1.0, 0.0));
  const double norm = std::sqrt(s[0] * s[0] - s[2] * s[2]);
  std::vector<Rigid3> poses;
  for (const double sign : {1.0, -1.0}) {
    const Eigen::Vector3d u = (p * V.col(0) + sign * q * V.col(2)) / norm;
    const Eigen::Vector3d v2 = V.col(1);
    const Eigen::Vector3d normal = v2.cross(u);
    Eigen::Matrix3d U, W;
    U << v2, u, normal;
    W << H * v2, H * u, (H * v2).cross(H * u);
    const Eigen::Matrix3d R = W * U.transpose();
    const Eigen::Vector3d t = ((H - R) * normal).normalized();
    if (!R.allFinite() || !t.allFinite()) continue;
    poses.emplace_back(R, t);
    poses.emplace_back(R, -t);
  }
  return poses;
}

namespace {

// n with n^T x = 1 on the plane: where the inverse depth is nearest to linear in the image, so that points
// count by what the images say of them. Those far from it count less.
std::optional<Eigen::Vector3d> FitPlane(std::span<const Eigen::Vector3d> points) {
  constexpr int kRounds = 5;
  constexpr size_t kMinPoints = 8;
  if (points.size() < kMinPoints) return std::nullopt;
  Eigen::Vector3d plane = Eigen::Vector3d::Zero();
  std::vector<double> residuals(points.size()), sorted;
  double scale = std::numeric_limits<double>::infinity();  // all count the same in the first round
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d ray = points[i] / points[i].z();
      const double relative = residuals[i] / scale, weight = 1 / (1 + relative * relative);
      normal += weight * ray * ray.transpose();
      right += weight * ray / points[i].z();
    }
    const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
    if (solver.info() != Eigen::Success || !(solver.rcond() > 1e-9)) return std::nullopt;
    plane = solver.solve(right);
    for (size_t i = 0; i < points.size(); ++i)
      residuals[i] = std::abs(plane.dot(points[i]) - 1) / points[i].z();
    sorted = residuals;
    std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
    scale = sorted[sorted.size() / 2];
    if (!(scale > 1e-12 * plane.norm())) break;  // on the plane
  }
  return plane;
}

}  // namespace

std::optional<Rigid3> TwinMotion(const Rigid3& second_from_first,
                                 std::span<const Eigen::Vector3d> points_in_first) {
  const auto plane = FitPlane(points_in_first);
  if (!plane) return std::nullopt;
  const Eigen::Matrix3d H = second_from_first.Matrix() + second_from_first.translation * plane->transpose();
  std::optional<Rigid3> twin;
  double farthest_rad = 1e-4;  // the motion itself, as it comes back
  for (const Rigid3& pose : PosesFromHomography(H)) {
    const double angle_rad = RotationAngle(pose.rotation, second_from_first.rotation);
    if (angle_rad <= farthest_rad || pose.translation.squaredNorm() == 0) continue;
    farthest_rad = angle_rad;
    twin = pose;
  }
  return twin;
}

}  // namespace dynamic_slam
