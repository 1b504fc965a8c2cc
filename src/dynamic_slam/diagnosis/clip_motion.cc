#include "dynamic_slam/diagnosis/clip_motion.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include <Eigen/Geometry>

#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/geometry/ransac.h"

namespace dynamic_slam {
namespace {

constexpr double kToleratedPx = 2;

double Score(double squared_error_px) {
  return std::max(0.0, 1 - squared_error_px / (kToleratedPx * kToleratedPx));
}

struct Rays {
  Eigen::Vector3d first, second;
};

Rays ToRays(const PixelPair& match, double fx, double fy) {
  return {{match.x1 / fx, match.y1 / fy, 1}, {match.x2 / fx, match.y2 / fy, 1}};
}

// Axes of which the first is a and the second in the plane of a and b.
Eigen::Matrix3d Frame(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  Eigen::Matrix3d axes;
  axes.col(0) = a.normalized();
  axes.col(2) = a.cross(b).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

double SampsonScore(const Eigen::Matrix3d& E, double fx, double fy, std::span<const PixelPair> matches) {
  double score = 0;
  for (const PixelPair& match : matches) {
    const Rays rays = ToRays(match, fx, fy);
    const Eigen::Vector3d line2 = E * rays.first, line1 = E.transpose() * rays.second;
    const double residual = rays.second.dot(line2);
    // Gradients by px: a ray moves by 1 / f.
    const double gradient = (line2.x() * line2.x() + line1.x() * line1.x()) / (fx * fx) +
                            (line2.y() * line2.y() + line1.y() * line1.y()) / (fy * fy);
    if (gradient > 0) score += Score(residual * residual / gradient);
  }
  return score;
}

}  // namespace

ImagePair MatchImages(const Camera& camera, const FeatureSet& first, const FeatureSet& second) {
  constexpr double kRatio = 0.8;
  std::vector<uint32_t> all_first(first.size()), all_second(second.size());
  std::iota(all_first.begin(), all_first.end(), 0u);
  std::iota(all_second.begin(), all_second.end(), 0u);
  const std::vector<Match> matches =
      MatchMutual(first, all_first, second, all_second, kStrictDistance, kRatio);
  RotationConsistency turning;
  for (const Match& match : matches) {
    turning.Add(first.keypoints[match.first].angle_rad, second.keypoints[match.second].angle_rad);
  }
  const std::vector<uint8_t>& keep = turning.Judge();
  ImagePair pair;
  std::vector<double> motions;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (keep[i] == 0) continue;
    const Keypoint &a = first.keypoints[matches[i].first], &b = second.keypoints[matches[i].second];
    pair.matches.push_back({a.x - camera.cx, a.y - camera.cy, b.x - camera.cx, b.y - camera.cy});
    motions.push_back(std::hypot(a.x - b.x, a.y - b.y));
  }
  if (!motions.empty()) {
    const auto middle = motions.begin() + static_cast<ptrdiff_t>(motions.size() / 2);
    std::nth_element(motions.begin(), middle, motions.end());
    pair.motion_px = *middle;
  }
  return pair;
}

double RotationScore(const Camera& camera, const ImagePair& pair, Random* random) {
  constexpr int kSamples = 100;
  if (pair.matches.size() < 2) return 0;
  double best = 0;
  for (int i = 0; i < kSamples; ++i) {
    const auto sample = DrawSample<2>(static_cast<uint32_t>(pair.matches.size()), *random);
    const Rays a = ToRays(pair.matches[sample[0]], camera.fx, camera.fy),
               b = ToRays(pair.matches[sample[1]], camera.fx, camera.fy);
    const Eigen::Matrix3d R = Frame(a.second, b.second) * Frame(a.first, b.first).transpose();
    if (!R.allFinite()) continue;
    double score = 0;
    for (const PixelPair& match : pair.matches) {
      const Eigen::Vector3d turned = R * ToRays(match, camera.fx, camera.fy).first;
      if (!(turned.z() > 0)) continue;
      const double dx = camera.fx * turned.x() / turned.z() - match.x2,
                   dy = camera.fy * turned.y() / turned.z() - match.y2;
      score += Score(dx * dx + dy * dy);
    }
    best = std::max(best, score);
  }
  return best;
}

double EpipolarScore(const Camera& camera, const ImagePair& pair, Random* random) {
  constexpr int kSamples = 100, kRefinements = 10;
  const double fx = camera.fx, fy = camera.fy;
  if (pair.matches.size() < 5) return 0;
  double best_score = 0;
  Eigen::Matrix3d best = Eigen::Matrix3d::Zero();
  for (int i = 0; i < kSamples; ++i) {
    const auto sample = DrawSample<5>(static_cast<uint32_t>(pair.matches.size()), *random);
    std::array<Eigen::Vector3d, 5> first, second;
    for (size_t k = 0; k < sample.size(); ++k) {
      const Rays rays = ToRays(pair.matches[sample[k]], fx, fy);
      first[k] = rays.first;
      second[k] = rays.second;
    }
    for (const Eigen::Matrix3d& E : FivePointEssential(first, second)) {
      const double score = SampsonScore(E, fx, fy, pair.matches);
      if (score > best_score) {
        best_score = score;
        best = E;
      }
    }
  }
  if (!(best_score > 0)) return 0;
  for (const Rigid3& pose : PosesFromEssential(best)) {
    const Rigid3 refined = RefineRelativePose(pair.matches, fx, fy, 2 * kToleratedPx, kRefinements, pose);
    best_score = std::max(best_score, SampsonScore(EssentialFromPose(refined), fx, fy, pair.matches));
  }
  return best_score;
}

}  // namespace dynamic_slam
