#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/sim3.h"

namespace dynamic_slam {

// One point of the world, as two cameras with units of length of their own know and see it.
struct Sim3Match {
  Eigen::Vector3d x_in_first, x_in_second;
  Eigen::Vector2d first_px, second_px;  // ideal
  double first_sigma_px = 1, second_sigma_px = 1;
};

// A point that the second camera knows, as another camera beside the first one sees it. Its place beside the
// first is in the first one's unit of length: so a few of them know the scale, which images from one place do
// not.
struct Sim3Sighting {
  Rigid3 cam_from_first;
  Eigen::Vector3d x_in_second;
  Eigen::Vector2d px;  // ideal
  double sigma_px = 1;
};

struct Sim3Options {
  int min_inliers = 10;
  double chi2 = 9.21;
  double ransac_confidence = 0.999;
  int max_ransac_iterations = 500;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("min_inliers", self.min_inliers, OptionField{"", 4, 5000, "Matches that must fit the similarity."});
    visit("chi2", self.chi2,
          OptionField{
              "", 0.1, 100,
              "A match fits when both squared reprojection errors, in sigmas, are below this (99%: 9.21)."});
    visit("ransac_confidence", self.ransac_confidence,
          OptionField{"", 0.5, 0.999999, "Probability of having drawn a sample without outliers."});
    visit("max_ransac_iterations", self.max_ransac_iterations,
          OptionField{"", 1, 100000, "Samples drawn at most."});
  }
};

struct Sim3Estimate {
  bool success = false;    // at least min_inliers matches fit
  Sim3 first_from_second;  // the best found, also when there are too few inliers
  int inliers = 0;
  std::vector<uint8_t> is_inlier;  // per match: before both cameras, and both errors within chi2
};

// The similarity between two cameras from matched points, wrong ones among them: three points in closed form
// (Horn 1987, Umeyama 1991) in RANSAC, judged by the reprojection of each point into the other image, then
// refined. Where the two cameras are at one place, no image depends on the scale: then the depths that both
// know decide, each with an uncertainty of a fifth.
Sim3Estimate EstimateSim3(const Camera& camera, std::span<const Sim3Match> matches,
                          const Sim3Options& options, Random& random);

// Minimises the reprojection errors, also those of the sightings, and differences of depth from a first
// guess, without what does not fit. Inliers are among the matches.
Sim3Estimate RefineSim3(const Camera& camera, std::span<const Sim3Match> matches, const Sim3Options& options,
                        const Sim3& first_from_second, std::span<const Sim3Sighting> sightings = {});

}  // namespace dynamic_slam
