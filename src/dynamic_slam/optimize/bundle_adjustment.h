#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// Poses, points, what the poses saw of the points, and how the poses follow each other. Fixed poses and
// points constrain but do not move.
struct BundleProblem {
  struct Pose {
    Rigid3 cam_from_world;
    bool fixed = false;
  };
  struct Point {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  // in world
    bool fixed = false;
  };
  struct Observation {
    uint32_t pose = 0;   // index in poses
    uint32_t point = 0;  // index in points
    Eigen::Vector2d ideal_px = Eigen::Vector2d::Zero();
    double inverse_sigma_px = 1.0;  // 1 / (standard deviation of the keypoint: the scale of its octave)
    double weight = 1.0;            // trust in the observation: 1 is certain, 0 is not used
  };

  // Of three poses, one after the other: what carries a camera has mass, so its mean velocity from the first
  // to the second, turned along, is nearly that from the second to the third.
  struct Motion {
    std::array<uint32_t, 3> poses{};                     // indices in poses
    double first_s = 0, second_s = 0;                    // the times between them
    double inverse_sigma = 1;                            // 1 / (standard deviation of the change of velocity)
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();  // of the velocity between the steps, in the world
  };

  std::vector<Pose> poses;
  std::vector<Point> points;
  std::vector<Observation> observations;
  std::vector<Motion> motions;
};

struct BundleOptions {
  int max_iterations = 5;
  int refine_iterations = 10;
  bool reject_outliers = true;
  double chi2 = 5.991;
  double function_tolerance = 1e-4;
  int num_threads = 1;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("max_iterations", self.max_iterations,
          OptionField{"", 1, 1000, "Most steps of the first round, which has a Huber kernel."});
    visit("refine_iterations", self.refine_iterations,
          OptionField{"", 0, 1000, "Most steps of the second round, if reject_outliers."});
    visit("reject_outliers", self.reject_outliers,
          OptionField{"", 0, 1, "Run a second round without the outliers of the first, and without kernel."});
    visit("chi2", self.chi2,
          OptionField{"", 0.1, 100, "A squared error above this, in sigmas, makes an outlier (95%: 5.991)."});
    visit("function_tolerance", self.function_tolerance,
          OptionField{"", 0, 1, "A round ends when a step lowers the cost by less than this part of it."});
    visit("num_threads", self.num_threads,
          OptionField{"", 1, 64, "Threads of the solver; only 1 gives the same bytes every time."});
  }
};

struct BundleSummary {
  double initial_cost = 0;  // robust cost of the first round at the start: half the sum of squared sigmas
  double final_cost = 0;    // the same function of the same observations at the end
  int iterations = 0;       // accepted and refused steps, both rounds
  bool usable = false;      // false: nothing was written back
  bool stopped = false;     // should_stop ended it; the best state so far was written back if usable
  int outliers = 0;
};

// With fewer fixed points, and no fixed pose, the world could drift.
inline constexpr size_t kFewestPointsToHoldWorld = 3;

// Minimises the reprojection error over all free poses and points and writes them back into `problem`.
//
// `should_stop` may be empty; it is asked between steps, from the calling thread. `is_outlier` gets one entry
// for each observation: its point is behind the camera or its error exceeds chi2 at the end. Fixed entries
// are not touched. At least one pose or kFewestPointsToHoldWorld must be fixed: that, and indices out of
// range, are checked (InternalError). An observation with a weight of 0 or a non-finite number is not used.
BundleSummary AdjustBundle(const Camera& camera, const BundleOptions& options,
                           const std::function<bool()>& should_stop, BundleProblem* problem,
                           std::vector<uint8_t>* is_outlier);

}  // namespace dynamic_slam
