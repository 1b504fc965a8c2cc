#include "dynamic_slam/geometry/sim3_estimation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "dynamic_slam/geometry/ransac.h"
#include "dynamic_slam/geometry/umeyama.h"

namespace dynamic_slam {
namespace {

constexpr double kBehind = 1e30;
constexpr int kSampleRefinements = 3, kFinalRefinements = 15;

// Of the quotient of two depths of a point, as a logarithm: at the least parallax of a landmark, 1 deg, and
// with a pixel of 1/500 of the focal length, either is known to some 0.11.
constexpr double kLogDepthSigma = 0.2;

using Vector7d = Eigen::Matrix<double, 7, 1>;

struct Errors {
  double first = 0, second = 0, depth = 0;  // squared, in sigmas

  double WorstPixel() const { return std::max(first, second); }
  double Worst() const { return std::max(WorstPixel(), depth); }
};

Eigen::Matrix<double, 2, 3> ProjectionJacobian(const Camera& camera, const Eigen::Vector3d& x) {
  const double iz = 1 / x.z();
  Eigen::Matrix<double, 2, 3> J;
  J << camera.fx * iz, 0, -camera.fx * x.x() * iz * iz, 0, camera.fy * iz, -camera.fy * x.y() * iz * iz;
  return J;
}

class Problem {
 public:
  Problem(const Camera& camera, std::span<const Sim3Match> matches, double chi2,
          std::span<const Sim3Sighting> sightings = {})
      : camera_(camera), matches_(matches), sightings_(sightings), chi2_(chi2) {}

  // Sum over the matches of 1 at no error, falling to 0 at the threshold.
  double Score(const Sim3& first_from_second) const {
    const Sim3 second_from_first = first_from_second.Inverse();
    double score = 0;
    for (const Sim3Match& match : matches_) {
      score += std::max(0.0, 1 - ErrorsOf(match, first_from_second, second_from_first).Worst() / chi2_);
    }
    for (const Sim3Sighting& sighting : sightings_) {
      const Eigen::Vector3d x = sighting.cam_from_first * (first_from_second * sighting.x_in_second);
      if (!(x.z() > 0)) continue;
      const Eigen::Vector2d r = (camera_.Project(x) - sighting.px) / sighting.sigma_px;
      score += std::max(0.0, 1 - r.squaredNorm() / chi2_);
    }
    return score;
  }

  int CountInliers(const Sim3& first_from_second, std::vector<uint8_t>* is_inlier) const {
    const Sim3 second_from_first = first_from_second.Inverse();
    is_inlier->assign(matches_.size(), 0);
    int inliers = 0;
    for (size_t i = 0; i < matches_.size(); ++i) {
      if (ErrorsOf(matches_[i], first_from_second, second_from_first).WorstPixel() > chi2_) continue;
      (*is_inlier)[i] = 1;
      ++inliers;
    }
    return inliers;
  }

  // Gauss-Newton with Tukey's weights, which vanish at twice the threshold. Increments are (rotation vector,
  // translation, logarithm of the scale) and multiply from the left.
  Sim3 Refine(Sim3 first_from_second, int iterations) const {
    for (int iteration = 0; iteration < iterations; ++iteration) {
      Eigen::Matrix<double, 7, 7> A = Eigen::Matrix<double, 7, 7>::Zero();
      Vector7d b = Vector7d::Zero();
      const Sim3 second_from_first = first_from_second.Inverse();
      const Eigen::Matrix3d second_turn =
          second_from_first.scale * second_from_first.rotation.toRotationMatrix();
      const auto add = [&](const Eigen::Vector3d& x, const Eigen::Vector2d& px, double sigma_px,
                           const Eigen::Matrix<double, 3, 7>& by_increment) {
        const Eigen::Vector2d r = (camera_.Project(x) - px) / sigma_px;
        const double u = Weight(r.squaredNorm());
        const Eigen::Matrix<double, 2, 7> J = ProjectionJacobian(camera_, x) / sigma_px * by_increment;
        A.noalias() += u * J.transpose() * J;
        b.noalias() += u * J.transpose() * r;
      };
      // Of a match that fits both images.
      const auto add_depth = [&](const Sim3Match& match, const Eigen::Vector3d& in_first) {
        const double r = DepthError(match, in_first);
        const Vector7d J = Moved(in_first).row(2).transpose() / (in_first.z() * kLogDepthSigma);
        const double u = Weight(r * r);
        A.noalias() += u * J * J.transpose();
        b.noalias() += u * J * r;
      };
      for (const Sim3Match& match : matches_) {
        const Eigen::Vector3d in_first = first_from_second * match.x_in_second;
        const Eigen::Vector3d in_second = second_from_first * match.x_in_first;
        if (!(in_first.z() > 0 && in_second.z() > 0)) continue;
        add(in_first, match.first_px, match.first_sigma_px, Moved(in_first));
        add(in_second, match.second_px, match.second_sigma_px, -second_turn * Moved(match.x_in_first));
        if (ErrorsOf(match, first_from_second, second_from_first).WorstPixel() <= 2 * chi2_) {
          add_depth(match, in_first);
        }
      }
      for (const Sim3Sighting& sighting : sightings_) {
        const Eigen::Vector3d in_first = first_from_second * sighting.x_in_second;
        const Eigen::Vector3d x = sighting.cam_from_first * in_first;
        if (!(x.z() > 0)) continue;
        add(x, sighting.px, sighting.sigma_px,
            sighting.cam_from_first.rotation.toRotationMatrix() * Moved(in_first));
      }
      A.diagonal() *= 1 + 1e-9;
      const Vector7d step = -A.ldlt().solve(b);
      if (!step.allFinite() || std::abs(step(6)) > 1) break;
      first_from_second =
          Sim3{std::exp(step(6)), ExpSo3(step.head<3>()), step.segment<3>(3)} * first_from_second;
      if (step.squaredNorm() < 1e-20) break;
    }
    return first_from_second;
  }

 private:
  // Tukey's, of a squared error in sigmas.
  double Weight(double squared_error) const {
    const double u = std::max(0.0, 1 - squared_error / (2 * chi2_));
    return u * u;
  }

  // d (increment * x) / d increment at 0
  static Eigen::Matrix<double, 3, 7> Moved(const Eigen::Vector3d& x) {
    Eigen::Matrix<double, 3, 7> J;
    J << -Skew(x), Eigen::Matrix3d::Identity(), x;
    return J;
  }

  Errors ErrorsOf(const Sim3Match& match, const Sim3& first_from_second,
                  const Sim3& second_from_first) const {
    const Eigen::Vector3d in_first = first_from_second * match.x_in_second;
    const Eigen::Vector3d in_second = second_from_first * match.x_in_first;
    if (!(in_first.z() > 0 && in_second.z() > 0)) return {kBehind, kBehind, kBehind};
    return {((camera_.Project(in_first) - match.first_px) / match.first_sigma_px).squaredNorm(),
            ((camera_.Project(in_second) - match.second_px) / match.second_sigma_px).squaredNorm(),
            DepthError(match, in_first) * DepthError(match, in_first)};
  }

  // In sigmas.
  static double DepthError(const Sim3Match& match, const Eigen::Vector3d& in_first) {
    return std::log(in_first.z() / match.x_in_first.z()) / kLogDepthSigma;
  }

  const Camera& camera_;
  std::span<const Sim3Match> matches_;
  std::span<const Sim3Sighting> sightings_;
  double chi2_;
};

}  // namespace

Sim3Estimate EstimateSim3(const Camera& camera, std::span<const Sim3Match> matches,
                          const Sim3Options& options, Random& random) {
  Sim3Estimate estimate;
  estimate.is_inlier.assign(matches.size(), 0);
  if (matches.size() < 3 || static_cast<int>(matches.size()) < options.min_inliers) return estimate;
  const Problem problem(camera, matches, options.chi2);
  double best_sampled = 0, best_score = 0;
  int needed = options.max_ransac_iterations;
  for (int iteration = 0; iteration < needed; ++iteration) {
    std::vector<Eigen::Vector3d> first, second;
    for (const uint32_t i : DrawSample<3>(static_cast<uint32_t>(matches.size()), random)) {
      first.push_back(matches[i].x_in_first);
      second.push_back(matches[i].x_in_second);
    }
    const std::optional<Sim3> sampled = AlignUmeyama(second, first, true);
    if (!sampled.has_value() || !(sampled->scale > 0)) continue;
    const double sampled_score = problem.Score(*sampled);
    if (sampled_score <= best_sampled) continue;
    best_sampled = sampled_score;
    const Sim3 refined = problem.Refine(*sampled, kSampleRefinements);
    const double refined_score = problem.Score(refined);
    if (std::max(refined_score, sampled_score) <= best_score) continue;
    best_score = std::max(refined_score, sampled_score);
    estimate.first_from_second = refined_score > sampled_score ? refined : *sampled;
    const double inliers = problem.CountInliers(estimate.first_from_second, &estimate.is_inlier);
    needed = RansacIterations(inliers / static_cast<double>(matches.size()), 3, options.ransac_confidence,
                              options.max_ransac_iterations);
  }
  if (best_score == 0) return estimate;
  return RefineSim3(camera, matches, options, estimate.first_from_second);
}

Sim3Estimate RefineSim3(const Camera& camera, std::span<const Sim3Match> matches, const Sim3Options& options,
                        const Sim3& first_from_second, std::span<const Sim3Sighting> sightings) {
  const Problem problem(camera, matches, options.chi2, sightings);
  const Sim3 refined = problem.Refine(first_from_second, kFinalRefinements);
  Sim3Estimate estimate;
  estimate.first_from_second =
      problem.Score(refined) >= problem.Score(first_from_second) ? refined : first_from_second;
  estimate.inliers = problem.CountInliers(estimate.first_from_second, &estimate.is_inlier);
  estimate.success = estimate.inliers >= options.min_inliers;
  return estimate;
}

}  // namespace dynamic_slam
