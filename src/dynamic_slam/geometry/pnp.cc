#include "dynamic_slam/geometry/pnp.h"

#include <cmath>

#include <Eigen/Cholesky>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/geometry/p3p.h"
#include "dynamic_slam/geometry/ransac.h"

namespace dynamic_slam {
namespace {

constexpr double kChi2 = 5.99;  // 95% quantile, 2 degrees of freedom

struct Problem {
  const Camera& camera;
  std::span<const Eigen::Vector3d> points;
  std::span<const Eigen::Vector2d> pixels;
  std::vector<double> inverse_sigma;

  // Squared reprojection error over sigma^2; above every threshold behind the camera.
  double Error(const Eigen::Matrix3d& R, const Eigen::Vector3d& t, size_t i) const {
    const Eigen::Vector3d x = R * points[i] + t;
    if (!(x.z() > 0)) return 1e30;
    return ((camera.Project(x) - pixels[i]) * inverse_sigma[i]).squaredNorm();
  }

  // Sum over the matches of 1 at no error, falling to 0 at the inlier threshold.
  double Score(const Rigid3& cam_from_world) const {
    const Eigen::Matrix3d R = cam_from_world.Matrix();
    double score = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      score += std::max(0.0, 1.0 - Error(R, cam_from_world.translation, i) / kChi2);
    }
    return score;
  }

  int CountInliers(const Rigid3& cam_from_world, std::vector<uint8_t>* is_inlier) const {
    const Eigen::Matrix3d R = cam_from_world.Matrix();
    int inliers = 0;
    if (is_inlier != nullptr) is_inlier->assign(points.size(), 0);
    for (size_t i = 0; i < points.size(); ++i) {
      if (Error(R, cam_from_world.translation, i) > kChi2) continue;
      ++inliers;
      if (is_inlier != nullptr) (*is_inlier)[i] = 1;
    }
    return inliers;
  }

  // Gauss-Newton on the reprojection errors, with Tukey's weights that vanish at twice the inlier threshold.
  Rigid3 Refine(const Rigid3& cam_from_world, int iterations) const {
    Rigid3 pose = cam_from_world;
    for (int iteration = 0; iteration < iterations; ++iteration) {
      Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
      Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
      const Eigen::Matrix3d R = pose.Matrix();
      for (size_t i = 0; i < points.size(); ++i) {
        const Eigen::Vector3d x = R * points[i] + pose.translation;
        if (!(x.z() > 0)) continue;
        const Eigen::Vector2d r = (camera.Project(x) - pixels[i]) * inverse_sigma[i];
        const double u = 1.0 - r.squaredNorm() / (2 * kChi2);
        if (u <= 0) continue;
        const double iz = 1.0 / x.z();
        Eigen::Matrix<double, 2, 3> projection;
        projection << camera.fx * iz, 0, -camera.fx * x.x() * iz * iz, 0, camera.fy * iz,
            -camera.fy * x.y() * iz * iz;
        Eigen::Matrix<double, 2, 6> J;  // by rotation, then translation, both applied on the left
        J << -projection * Skew(x), projection;
        J *= inverse_sigma[i];
        A.noalias() += u * u * J.transpose() * J;
        b.noalias() += u * u * J.transpose() * r;
      }
      A.diagonal() *= 1.0 + 1e-9;
      const Eigen::Matrix<double, 6, 1> step = -A.ldlt().solve(b);
      if (!step.allFinite()) break;
      const Eigen::Quaterniond turn = ExpSo3(step.head<3>());
      pose = Rigid3(turn * pose.rotation, turn * pose.translation + step.tail<3>());
      if (step.squaredNorm() < 1e-24) break;
    }
    return pose;
  }
};

}  // namespace

PnpResult EstimatePnp(const Camera& camera, std::span<const Eigen::Vector3d> points_in_world,
                      std::span<const Eigen::Vector2d> ideal_px, std::span<const double> sigma_px,
                      const PnpOptions& options, Random& random) {
  DS_CHECK(points_in_world.size() == ideal_px.size() && sigma_px.size() == ideal_px.size(),
           "{} points, {} pixels, {} sigmas", points_in_world.size(), ideal_px.size(), sigma_px.size());
  const size_t n = points_in_world.size();
  PnpResult result;
  result.is_inlier.assign(n, 0);
  if (n < 4 || static_cast<int>(n) < options.min_inliers) return result;

  Problem problem{camera, points_in_world, ideal_px, {}};
  std::vector<Eigen::Vector3d> rays(n);
  problem.inverse_sigma.resize(n);
  for (size_t i = 0; i < n; ++i) {
    rays[i] = camera.Unproject(ideal_px[i]);
    problem.inverse_sigma[i] = 1.0 / sigma_px[i];
  }

  double best_sampled = 0, best_score = 0;
  int needed = options.max_ransac_iterations;
  for (int iteration = 0; iteration < needed; ++iteration) {
    const auto s = DrawSample<3>(static_cast<uint32_t>(n), random);
    for (const Rigid3& sampled :
         SolveP3p({points_in_world[s[0]], points_in_world[s[1]], points_in_world[s[2]]},
                  {rays[s[0]], rays[s[1]], rays[s[2]]})) {
      const double sampled_score = problem.Score(sampled);
      // Local optimisation (Chum, Matas and Kittler 2003) of every sample that beats the samples before it.
      if (sampled_score <= best_sampled) continue;
      best_sampled = sampled_score;
      const Rigid3 refined = problem.Refine(sampled, 4);
      const double refined_score = problem.Score(refined);
      const bool better = refined_score > sampled_score;
      if (std::max(refined_score, sampled_score) <= best_score) continue;
      best_score = std::max(refined_score, sampled_score);
      result.cam_from_world = better ? refined : sampled;
      const double ratio = static_cast<double>(problem.CountInliers(result.cam_from_world, nullptr)) / n;
      needed = RansacIterations(ratio, 3, options.ransac_confidence, options.max_ransac_iterations);
    }
  }
  if (best_score == 0) return result;
  const Rigid3 refined = problem.Refine(result.cam_from_world, 10);
  if (problem.Score(refined) >= best_score) result.cam_from_world = refined;
  result.inliers = problem.CountInliers(result.cam_from_world, &result.is_inlier);
  result.success = result.inliers >= options.min_inliers;
  return result;
}

}  // namespace dynamic_slam
