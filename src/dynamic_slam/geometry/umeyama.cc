#include "dynamic_slam/geometry/umeyama.h"

#include <Eigen/LU>
#include <Eigen/SVD>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

Eigen::Vector3d Mean(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

}  // namespace

std::optional<Sim3> AlignUmeyama(const std::vector<Eigen::Vector3d>& source,
                                 const std::vector<Eigen::Vector3d>& target, bool with_scale) {
  DS_CHECK(source.size() == target.size(), "{} and {}", source.size(), target.size());
  if (source.size() < 3) return std::nullopt;

  const Eigen::Vector3d source_mean = Mean(source), target_mean = Mean(target);
  double source_variance = 0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // Eq. (38)
  for (size_t i = 0; i < source.size(); ++i) {
    source_variance += (source[i] - source_mean).squaredNorm();
    covariance += (target[i] - target_mean) * (source[i] - source_mean).transpose();
  }
  source_variance /= static_cast<double>(source.size());
  covariance /= static_cast<double>(source.size());

  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d singular_values = svd.singularValues();
  constexpr double kRankTolerance = 1e-12;
  if (!(singular_values(1) > kRankTolerance * singular_values(0))) return std::nullopt;

  // Eq. (39), (43): the sign that keeps the rotation from being a reflection.
  Eigen::Vector3d signs(1, 1, 1);
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) signs(2) = -1;

  Sim3 target_from_source;
  const Eigen::Matrix3d R = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();  // Eq. (40)
  target_from_source.rotation = Eigen::Quaterniond(R).normalized();
  target_from_source.scale = with_scale ? singular_values.dot(signs) / source_variance : 1.0;  // Eq. (42)
  target_from_source.translation =
      target_mean - target_from_source.scale * (target_from_source.rotation * source_mean);  // Eq. (41)
  return target_from_source;
}

}  // namespace dynamic_slam
