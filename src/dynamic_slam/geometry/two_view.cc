#include "dynamic_slam/geometry/two_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <fmt/format.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/geometry/essential.h"
#include "dynamic_slam/geometry/homography.h"
#include "dynamic_slam/geometry/ransac.h"
#include "dynamic_slam/geometry/triangulation.h"

namespace dynamic_slam {
namespace {

constexpr double kChi2Line = 3.84;   // 95% quantile, 1 degree of freedom: distance to an epipolar line
constexpr double kChi2Point = 5.99;  // 2 degrees of freedom: distance to a point
constexpr double kRadToDeg = 180.0 / std::numbers::pi;
constexpr double kMinPlaneScore = 0.4;  // relative to the epipolar score: below, the scene is far from planar
constexpr int kLanes = 8;

// Match coordinates relative to the principal point, in px: one array each, filled up with NaN to whole
// lanes, so that the compiler makes vector code of the scores below.
struct Matches {
  std::vector<float> x1, y1, x2, y2;
  std::vector<PixelPair> pairs;
  std::vector<Eigen::Vector3d> first_rays, second_rays;
  size_t size = 0;

  Matches(const Camera& camera, std::span<const Eigen::Vector2d> first_px,
          std::span<const Eigen::Vector2d> second_px)
      : size(first_px.size()) {
    const size_t padded = (size + kLanes - 1) / kLanes * kLanes;
    for (auto* v : {&x1, &y1, &x2, &y2}) v->assign(padded, std::numeric_limits<float>::quiet_NaN());
    pairs.resize(size);
    first_rays.resize(size);
    second_rays.resize(size);
    for (size_t i = 0; i < size; ++i) {
      PixelPair& m = pairs[i];
      m = {first_px[i].x() - camera.cx, first_px[i].y() - camera.cy, second_px[i].x() - camera.cx,
           second_px[i].y() - camera.cy};
      x1[i] = static_cast<float>(m.x1);
      y1[i] = static_cast<float>(m.y1);
      x2[i] = static_cast<float>(m.x2);
      y2[i] = static_cast<float>(m.y2);
      first_rays[i] = camera.Unproject(first_px[i]);
      second_rays[i] = camera.Unproject(second_px[i]);
    }
  }
};

float SumLanes(const float (&lanes)[kLanes]) {
  float sum = 0;
  for (const float lane : lanes) sum += lane;
  return sum;
}

// Both scores add, for each match and image, a value that falls from kChi2Point at no error to 0 at the 95%
// quantile of the error, so that a model that fits everything scores the same whatever its kind. (The
// ORB-SLAM paper cuts the epipolar score off at its threshold instead.) Errors are in sigma, noise in both
// images counted.

// Squared Sampson error, px^2.
inline float EpipolarError(const Eigen::Matrix3f& F, float x1, float y1, float x2, float y2) {
  const float a0 = F(0, 0) * x1 + F(0, 1) * y1 + F(0, 2), a1 = F(1, 0) * x1 + F(1, 1) * y1 + F(1, 2);
  const float b0 = F(0, 0) * x2 + F(1, 0) * y2 + F(2, 0), b1 = F(0, 1) * x2 + F(1, 1) * y2 + F(2, 1);
  const float n = x2 * a0 + y2 * a1 + F(2, 0) * x1 + F(2, 1) * y1 + F(2, 2);
  return n * n / (a0 * a0 + a1 * a1 + b0 * b0 + b1 * b1);
}

// Squared transfer error, px^2, over 2: the noise is in both images.
inline float TransferError(const Eigen::Matrix3f& H, float x1, float y1, float x2, float y2) {
  const float inverse_w = 1.0f / (H(2, 0) * x1 + H(2, 1) * y1 + H(2, 2));
  const float dx = (H(0, 0) * x1 + H(0, 1) * y1 + H(0, 2)) * inverse_w - x2;
  const float dy = (H(1, 0) * x1 + H(1, 1) * y1 + H(1, 2)) * inverse_w - y2;
  return 0.5f * (dx * dx + dy * dy);
}

double EpipolarScore(const Matches& m, const Eigen::Matrix3f& F, double sigma_px) {
  const float scale = static_cast<float>(1.0 / (kChi2Line * sigma_px * sigma_px));
  float lanes[kLanes] = {};
  for (size_t begin = 0; begin < m.x1.size(); begin += kLanes) {
    for (int k = 0; k < kLanes; ++k) {
      const size_t i = begin + k;
      const float score = 1.0f - scale * EpipolarError(F, m.x1[i], m.y1[i], m.x2[i], m.y2[i]);
      lanes[k] += score > 0 ? score : 0;  // 0 for NaN
    }
  }
  return 2 * kChi2Point * SumLanes(lanes);
}

double TransferScore(const Matches& m, const Eigen::Matrix3f& H, const Eigen::Matrix3f& H_inverse,
                     double sigma_px) {
  const float scale = static_cast<float>(1.0 / (kChi2Point * sigma_px * sigma_px));
  float lanes[kLanes] = {};
  for (size_t begin = 0; begin < m.x1.size(); begin += kLanes) {
    for (int k = 0; k < kLanes; ++k) {
      const size_t i = begin + k;
      const float forward = 1.0f - scale * TransferError(H, m.x1[i], m.y1[i], m.x2[i], m.y2[i]);
      const float backward = 1.0f - scale * TransferError(H_inverse, m.x2[i], m.y2[i], m.x1[i], m.y1[i]);
      lanes[k] += (forward > 0 ? forward : 0) + (backward > 0 ? backward : 0);
    }
  }
  return kChi2Point * SumLanes(lanes);
}

struct EpipolarModel {
  double score = 0;
  int inliers = 0;
  Rigid3 pose;  // one of the four of the essential matrix
};

struct PlaneModel {
  double score = 0;
  int inliers = 0;
  Eigen::Matrix3d second_H_first;  // between rays
};

class Estimator {
 public:
  Estimator(const Camera& camera, const Matches& matches, const TwoViewOptions& options)
      : camera_(camera),
        matches_(matches),
        options_(options),
        k_(camera.fx, camera.fy, 1.0),
        inverse_k_(1.0 / camera.fx, 1.0 / camera.fy, 1.0) {}

  // Draws samples until the epipolar model is good enough: a plane's matches fit it too.
  void RunRansac(Random& random, EpipolarModel* epipolar, PlaneModel* plane) const {
    int needed = options_.max_ransac_iterations;
    double best_epipolar_sample = 0, best_plane_sample = 0;
    for (int iteration = 0; iteration < needed || iteration < options_.min_ransac_iterations; ++iteration) {
      const auto sample = DrawSample<5>(static_cast<uint32_t>(matches_.size), random);
      std::array<Eigen::Vector3d, 5> first, second;
      for (int i = 0; i < 5; ++i) {
        first[i] = matches_.first_rays[sample[i]];
        second[i] = matches_.second_rays[sample[i]];
      }
      Eigen::Matrix3d best_E;
      bool improved = false;
      for (const Eigen::Matrix3d& E : FivePointEssential(first, second)) {
        const double score = EpipolarScore(matches_, Fundamental(E), options_.sigma_px);
        if (score <= best_epipolar_sample) continue;
        best_epipolar_sample = score;
        best_E = E;
        improved = true;
      }
      if (improved) {
        Consider(PosesFromEssential(best_E)[0], epipolar);
        needed = RansacIterations(static_cast<double>(epipolar->inliers) / matches_.size, 5,
                                  options_.ransac_confidence, options_.max_ransac_iterations);
      }
      const auto H = HomographyFromFour({first[0], first[1], first[2], first[3]},
                                        {second[0], second[1], second[2], second[3]});
      if (!H) continue;
      const double score = Score(*H);
      if (score <= best_plane_sample) continue;
      best_plane_sample = score;
      Consider(*H, plane);
    }
  }

  // Keeps a sample's pose, refined on all that fits it, when it is better than what is there.
  void Consider(const Rigid3& sampled, EpipolarModel* best) const {
    for (const Rigid3& pose : {sampled, Refine(matches_.pairs, sampled, 5)}) {
      const double score = EpipolarScore(matches_, Fundamental(EssentialFromPose(pose)), options_.sigma_px);
      if (score > best->score) *best = {score, CountEpipolarInliers(pose), pose};
    }
  }

  void Consider(const Eigen::Matrix3d& sampled, PlaneModel* best) const {
    Eigen::Matrix3d H = sampled;
    for (int step = 0; step < 3; ++step) {
      const double score = Score(H);
      std::vector<Eigen::Vector2d> first, second;
      const auto [forward, backward] = PixelHomographies(H);
      for (size_t i = 0; i < matches_.size; ++i) {
        if (!FitsPlane(forward, backward, i)) continue;
        first.push_back(matches_.first_rays[i].head<2>());
        second.push_back(matches_.second_rays[i].head<2>());
      }
      if (score > best->score) *best = {score, static_cast<int>(first.size()), H};
      const auto fitted = FitHomography(first, second);
      if (!fitted) break;
      H = *fitted;
    }
  }

  Rigid3 Refine(std::span<const PixelPair> pairs, const Rigid3& pose, int iterations) const {
    return RefineRelativePose(pairs, camera_.fx, camera_.fy, 3.0 * options_.sigma_px, iterations, pose);
  }

  // Squared epipolar errors over the inlier limit: below 1 for an inlier.
  std::vector<float> RelativeErrors(const Rigid3& pose) const {
    const Eigen::Matrix3f F = Fundamental(EssentialFromPose(pose));
    const float scale = static_cast<float>(1.0 / (kChi2Line * options_.sigma_px * options_.sigma_px));
    std::vector<float> errors(matches_.size);
    for (size_t i = 0; i < matches_.size; ++i) {
      errors[i] = scale * EpipolarError(F, matches_.x1[i], matches_.y1[i], matches_.x2[i], matches_.y2[i]);
    }
    return errors;
  }

 private:
  Eigen::Matrix3f Fundamental(const Eigen::Matrix3d& E) const {
    const Eigen::Matrix3d F = inverse_k_.asDiagonal() * E * inverse_k_.asDiagonal();
    return (F / F.norm()).cast<float>();
  }

  std::pair<Eigen::Matrix3f, Eigen::Matrix3f> PixelHomographies(const Eigen::Matrix3d& H) const {
    const Eigen::Matrix3d forward = k_.asDiagonal() * H * inverse_k_.asDiagonal();
    const Eigen::Matrix3d backward = k_.asDiagonal() * H.inverse() * inverse_k_.asDiagonal();
    return {(forward / forward(2, 2)).cast<float>(), (backward / backward(2, 2)).cast<float>()};
  }

  double Score(const Eigen::Matrix3d& H) const {
    const auto [forward, backward] = PixelHomographies(H);
    return TransferScore(matches_, forward, backward, options_.sigma_px);
  }

  bool FitsPlane(const Eigen::Matrix3f& forward, const Eigen::Matrix3f& backward, size_t i) const {
    const auto& m = matches_;
    const float limit = static_cast<float>(kChi2Point * options_.sigma_px * options_.sigma_px);
    return TransferError(forward, m.x1[i], m.y1[i], m.x2[i], m.y2[i]) < limit &&
           TransferError(backward, m.x2[i], m.y2[i], m.x1[i], m.y1[i]) < limit;
  }

  int CountEpipolarInliers(const Rigid3& pose) const {
    const auto errors = RelativeErrors(pose);
    return static_cast<int>(std::count_if(errors.begin(), errors.end(), [](float e) { return e < 1; }));
  }

  const Camera& camera_;
  const Matches& matches_;
  const TwoViewOptions& options_;
  Eigen::Vector3d k_, inverse_k_;
};

// What a motion makes of the matches. Matches with too little parallax to tell the sign of their depth count
// as in front: if only triangulated points counted, a wrong motion that makes parallax out of outliers would
// beat a pure rotation.
struct Reconstruction {
  Rigid3 second_from_first;
  double score = 0;  // 1 for each in front without epipolar error, 0 for each at the limit
  std::vector<uint8_t> is_in_front;
  std::vector<double> parallaxes_deg;  // of all that are in front
  int triangulated = 0;                // in front, reprojected well, with parallax
  std::vector<uint8_t> is_triangulated;
  std::vector<Eigen::Vector3d> points_in_first;

  // The parallax that a quarter of the points, and min_points of them, reach.
  double ParallaxDeg(int min_points) {
    const size_t rank = std::max<size_t>(min_points, parallaxes_deg.size() / 4);
    if (parallaxes_deg.size() < rank || rank == 0) return 0;
    const auto nth = parallaxes_deg.begin() + (rank - 1);
    std::nth_element(parallaxes_deg.begin(), nth, parallaxes_deg.end(), std::greater<>());
    return *nth;
  }
};

Reconstruction Reconstruct(const Camera& camera, const Matches& matches,
                           const std::vector<float>& relative_errors, const Rigid3& pose,
                           const TwoViewOptions& options) {
  Reconstruction result;
  result.second_from_first = pose;
  result.is_in_front.assign(matches.size, 0);
  result.is_triangulated.assign(matches.size, 0);
  result.points_in_first.resize(matches.size);
  const TwoViewTriangulator triangulator(pose);
  const Eigen::Matrix3d R = pose.Matrix();
  const double limit = kChi2Point * options.sigma_px * options.sigma_px;
  const auto error2 = [&camera](const Eigen::Vector3d& x, const Eigen::Vector3d& ray) {
    const double dx = camera.fx * (x.x() / x.z() - ray.x()), dy = camera.fy * (x.y() / x.z() - ray.y());
    return dx * dx + dy * dy;
  };
  for (size_t i = 0; i < matches.size; ++i) {
    if (!(relative_errors[i] < 1)) continue;
    const Eigen::Vector3d& first_ray = matches.first_rays[i];
    const Eigen::Vector3d& second_ray = matches.second_rays[i];
    const double parallax_deg = kRadToDeg * ParallaxAngle(R * first_ray, second_ray);
    const bool has_parallax = parallax_deg >= options.min_point_parallax_deg;
    std::optional<Eigen::Vector3d> point;
    if (has_parallax) {
      point = triangulator.Triangulate(first_ray, second_ray);
      if (!point) continue;
    }
    result.is_in_front[i] = 1;
    result.score += 1.0 - relative_errors[i];
    result.parallaxes_deg.push_back(parallax_deg);
    if (!has_parallax) continue;
    if (error2(*point, first_ray) > limit || error2(pose * *point, second_ray) > limit) continue;
    ++result.triangulated;
    result.is_triangulated[i] = 1;
    result.points_in_first[i] = *point;
  }
  return result;
}

// Whether two motions are rivals, not one motion reached from two sides. |translation| = 1.
bool AreDifferent(const Rigid3& a, const Rigid3& b) {
  return RotationAngle(a.rotation, b.rotation) > 0.02 || ParallaxAngle(a.translation, b.translation) > 0.1;
}

std::optional<Rigid3> TwinOf(const Reconstruction& found) {
  std::vector<Eigen::Vector3d> points;
  for (size_t i = 0; i < found.points_in_first.size(); ++i) {
    if (found.is_triangulated[i] != 0) points.push_back(found.points_in_first[i]);
  }
  return TwinMotion(found.second_from_first, points);
}

TwoViewMotion TakeMotion(Reconstruction&& from) {
  return {from.second_from_first, std::move(from.is_triangulated), std::move(from.points_in_first),
          from.triangulated};
}

}  // namespace

std::string Explain(const TwoViewResult& result) {
  switch (result.failure) {
    case TwoViewFailure::kNone:
      return fmt::format("two views: {:.1f} deg of parallax", result.parallax_deg);
    case TwoViewFailure::kTooFewMatches:
      return fmt::format("{:.0f} matches < {:.0f}; point the camera at texture", result.value, result.limit);
    case TwoViewFailure::kTooFewInliers:
      return fmt::format("{:.0f} matches fit one motion < {:.0f}; move more slowly", result.value,
                         result.limit);
    case TwoViewFailure::kLowParallax:
      return fmt::format("parallax {:.1f} deg < {:.1f} deg; move sideways", result.value, result.limit);
    case TwoViewFailure::kAmbiguous:
      return fmt::format(
          "two motions fit: the second scores {:.2f} of the first > {:.2f}; "
          "show something out of the plane",
          result.value, result.limit);
    case TwoViewFailure::kTooFewPoints:
      return fmt::format("{:.0f} points triangulated < {:.0f}; move sideways", result.value, result.limit);
  }
  return "";
}

TwoViewResult EstimateTwoView(const Camera& camera, std::span<const Eigen::Vector2d> first_px,
                              std::span<const Eigen::Vector2d> second_px, const TwoViewOptions& options,
                              Random& random) {
  DS_CHECK(first_px.size() == second_px.size(), "{} and {} pixels", first_px.size(), second_px.size());
  TwoViewResult result;
  result.motion.is_inlier.assign(first_px.size(), 0);
  result.motion.points_in_first.assign(first_px.size(), Eigen::Vector3d::Zero());
  const auto fail = [&result](TwoViewFailure failure, double value, double limit) {
    result.failure = failure;
    result.value = value;
    result.limit = limit;
    return result;
  };
  const int least = std::max(options.min_points, 8);
  if (static_cast<int>(first_px.size()) < least) {
    return fail(TwoViewFailure::kTooFewMatches, static_cast<double>(first_px.size()), least);
  }

  const Matches matches(camera, first_px, second_px);
  const Estimator estimator(camera, matches, options);
  EpipolarModel epipolar;
  PlaneModel plane;
  estimator.RunRansac(random, &epipolar, &plane);
  result.from_homography = plane.score > options.max_homography_score_ratio * (plane.score + epipolar.score);
  result.inliers = result.from_homography ? plane.inliers : epipolar.inliers;
  if (result.inliers < least) return fail(TwoViewFailure::kTooFewInliers, result.inliers, least);

  // Try every motion of both models: near a plane either may have found the wrong one of two that fit.
  std::vector<Rigid3> origins = {epipolar.pose};
  if (plane.score > kMinPlaneScore * epipolar.score) {
    const auto of_plane = PosesFromHomography(plane.second_H_first);
    for (size_t i = 0; i < of_plane.size(); i += 2) origins.push_back(of_plane[i]);  // pairs of +-t
  }
  std::vector<Reconstruction> tried;
  const auto by_score = [](const Reconstruction& a, const Reconstruction& b) { return a.score < b.score; };
  const auto try_motions_near = [&](const Rigid3& origin) {
    const Rigid3 refined = estimator.Refine(matches.pairs, origin, 10);
    const auto begin = static_cast<std::ptrdiff_t>(tried.size());
    for (const Rigid3& motion : PosesFromEssential(EssentialFromPose(refined))) {
      tried.push_back(Reconstruct(camera, matches, estimator.RelativeErrors(motion), motion, options));
    }
    // Matches behind the cameras are wrong and, far from where they belong, pull hard: refine without.
    Reconstruction& one = *std::max_element(tried.begin() + begin, tried.end(), by_score);
    std::vector<PixelPair> in_front;
    for (size_t i = 0; i < matches.size; ++i) {
      if (one.is_in_front[i]) in_front.push_back(matches.pairs[i]);
    }
    const Rigid3 cleaned = estimator.Refine(in_front, one.second_from_first, 10);
    one = Reconstruct(camera, matches, estimator.RelativeErrors(cleaned), cleaned, options);
  };
  for (const Rigid3& origin : origins) {
    if (origin.translation.squaredNorm() != 0) try_motions_near(origin);
  }
  if (tried.empty()) return fail(TwoViewFailure::kLowParallax, 0, options.min_parallax_deg);
  // Which of two motions the samples find is chance, so ask for the other one: a motion is only certain when
  // that does not fit.
  if (const auto twin = TwinOf(*std::max_element(tried.begin(), tried.end(), by_score)))
    try_motions_near(*twin);
  std::stable_sort(tried.begin(), tried.end(),
                   [](const Reconstruction& a, const Reconstruction& b) { return a.score > b.score; });
  Reconstruction& best = tried.front();
  std::vector<Reconstruction*> rivals;
  for (Reconstruction& other : tried) {
    bool is_new = AreDifferent(best.second_from_first, other.second_from_first);
    for (const Reconstruction* rival : rivals) {
      is_new = is_new && AreDifferent(rival->second_from_first, other.second_from_first);
    }
    if (is_new) rivals.push_back(&other);
  }
  const double rivalry = best.score <= 0 ? 1.0 : rivals.empty() ? 0.0 : rivals.front()->score / best.score;

  result.parallax_deg = best.ParallaxDeg(options.min_points);
  const double best_score = best.score;
  if (result.parallax_deg < options.min_parallax_deg) {
    return fail(TwoViewFailure::kLowParallax, result.parallax_deg, options.min_parallax_deg);
  }
  if (rivalry <= options.max_second_best_ratio && best.triangulated < options.min_points) {
    return fail(TwoViewFailure::kTooFewPoints, best.triangulated, options.min_points);
  }
  result.motion = TakeMotion(std::move(best));
  if (rivalry > options.max_second_best_ratio) {
    for (Reconstruction* rival : rivals) {
      if (rival->score > options.max_second_best_ratio * best_score)
        result.rivals.push_back(TakeMotion(std::move(*rival)));
    }
    return fail(TwoViewFailure::kAmbiguous, rivalry, options.max_second_best_ratio);
  }
  return result;
}

}  // namespace dynamic_slam
