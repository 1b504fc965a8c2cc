#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

struct PnpOptions {
  int min_inliers = 10;
  double ransac_confidence = 0.999;
  int max_ransac_iterations = 1000;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("min_inliers", self.min_inliers, OptionField{"", 4, 5000, "Matches that must fit the pose."});
    visit("ransac_confidence", self.ransac_confidence,
          OptionField{"", 0.5, 0.999999, "Probability of having drawn a sample without outliers."});
    visit("max_ransac_iterations", self.max_ransac_iterations,
          OptionField{"", 1, 100000, "Samples drawn at most."});
  }
};

struct PnpResult {
  bool success = false;   // at least min_inliers matches fit
  Rigid3 cam_from_world;  // the best pose found, also when there are too few inliers
  int inliers = 0;
  std::vector<uint8_t> is_inlier;  // per match: reprojection within the 95% quantile (5.99 sigma^2)
};

// Camera pose from matches of world points and ideal pixels, wrong ones among them: P3P in RANSAC, refined on
// the inliers. `sigma_px[i]` is the standard deviation of a coordinate of `ideal_px[i]`; the three spans are
// of one length.
PnpResult EstimatePnp(const Camera& camera, std::span<const Eigen::Vector3d> points_in_world,
                      std::span<const Eigen::Vector2d> ideal_px, std::span<const double> sigma_px,
                      const PnpOptions& options, Random& random);

}  // namespace dynamic_slam
