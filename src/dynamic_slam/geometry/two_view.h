#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

struct TwoViewOptions {
  double sigma_px = 1.0;
  int min_points = 50;
  double min_parallax_deg = 0.6;
  double min_point_parallax_deg = 0.3;
  double max_homography_score_ratio = 0.45;
  double max_second_best_ratio = 0.75;
  double ransac_confidence = 0.999;
  int min_ransac_iterations = 50;
  int max_ransac_iterations = 1000;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("sigma_px", self.sigma_px,
          OptionField{"px", 0.1, 10, "Standard deviation of a keypoint coordinate, for the inlier tests."});
    visit("min_points", self.min_points, OptionField{"", 8, 5000, "Points that must be triangulated."});
    visit("min_parallax_deg", self.min_parallax_deg,
          OptionField{"deg", 0, 45,
                      "Parallax that a quarter of the points, and at least min_points, must reach."});
    visit("min_point_parallax_deg", self.min_point_parallax_deg,
          OptionField{"deg", 0, 45, "Points with less parallax are not triangulated."});
    visit("max_homography_score_ratio", self.max_homography_score_ratio,
          OptionField{"", 0, 1,
                      "Share of the homography in both scores above which the scene counts as planar."});
    visit(
        "max_second_best_ratio", self.max_second_best_ratio,
        OptionField{"", 0, 1,
                    "Score of the second best motion, relative to the best, above which neither is taken."});
    visit("ransac_confidence", self.ransac_confidence,
          OptionField{"", 0.5, 0.999999, "Probability of having drawn a sample without outliers."});
    visit("min_ransac_iterations", self.min_ransac_iterations,
          OptionField{"", 1, 100000, "Samples drawn at least."});
    visit("max_ransac_iterations", self.max_ransac_iterations,
          OptionField{"", 1, 100000, "Samples drawn at most."});
  }
};

enum class TwoViewFailure {
  kNone,
  kTooFewMatches,
  kTooFewInliers,  // no motion and no plane explains enough matches
  kLowParallax,
  kAmbiguous,  // two different motions explain the matches about as well
  kTooFewPoints,
};

// One motion that explains the matches, and what it makes of them.
struct TwoViewMotion {
  Rigid3 second_from_first;                      // |translation| = 1
  std::vector<uint8_t> is_inlier;                // per match: triangulated
  std::vector<Eigen::Vector3d> points_in_first;  // per match; unset where !is_inlier
  int points = 0;
};

struct TwoViewResult {
  TwoViewFailure failure = TwoViewFailure::kNone;
  double value = 0;  // what was found wanting (matches, inliers, deg, ratio, points), and
  double limit = 0;  // what would have been enough

  bool from_homography = false;
  int inliers = 0;  // matches that fit the chosen model
  double parallax_deg =
      0;  // reached by a quarter of the points in front of both cameras, and by min_points of them
  TwoViewMotion motion;
  std::vector<TwoViewMotion> rivals;  // kAmbiguous: the others that explain the matches about as well

  bool Succeeded() const { return failure == TwoViewFailure::kNone; }
};

// One sentence with the numbers: "parallax 0.3 deg < 1.0 deg; move sideways".
std::string Explain(const TwoViewResult& result);

// Relative pose and structure from matches of one camera in two places (`first_px[i]` matches `second_px[i]`,
// ideal px). An essential matrix (five points) and a homography compete as in Mur-Artal, Montiel and Tardos,
// "ORB-SLAM", 2015, section IV; the winner's motions are tried on the points, and the clear best one is
// refined. On failure the motion is what was known until then: do not use it, but for kAmbiguous, where further views
// can tell it from its rivals.
TwoViewResult EstimateTwoView(const Camera& camera, std::span<const Eigen::Vector2d> first_px,
                              std::span<const Eigen::Vector2d> second_px, const TwoViewOptions& options,
                              Random& random);

}  // namespace dynamic_slam
