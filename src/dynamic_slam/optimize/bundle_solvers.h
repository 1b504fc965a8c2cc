#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/optimize/bundle_adjustment.h"

namespace dynamic_slam {

// One round of bundle adjustment, by two solvers that find the same minimum.

// Huber's loss of a squared error, with its corner at chi2.
inline double HuberLoss(double squared_error, double chi2) {
  return squared_error <= chi2 ? squared_error : 2 * std::sqrt(chi2 * squared_error) - chi2;
}

// The change of velocity, in sigmas, is the sum of these times the camera's centres.
inline std::array<Eigen::Matrix3d, 3> MotionFactors(const BundleProblem::Motion& motion) {
  const Eigen::Matrix3d first = motion.inverse_sigma / motion.first_s * motion.turn;
  const Eigen::Matrix3d second = motion.inverse_sigma / motion.second_s * Eigen::Matrix3d::Identity();
  return {first, -first - second, second};
}

struct BundleSolverOptions {
  // Squared error in sigmas at which Huber's loss begins; infinity for none.
  double huber_chi2 = 0;
  int max_iterations = 10;
  double function_tolerance = 1e-4;
  int num_threads = 1;  // of the sparse solver
};

struct BundleSolverResult {
  bool usable = false;   // false: nothing was changed
  bool stopped = false;  // should_stop ended it
  int iterations = 0;    // accepted and refused steps
};

// Levenberg and Marquardt's method: the points are eliminated first, the dense system of the poses that
// remains is factorised (Triggs et al., "Bundle adjustment: a modern synthesis", 2000, section 6.1). Several
// times faster than the sparse one for a few poses, as all is flat; cubic in their number.
//
// Observations whose `skip` is not 0 are left out; the others must be in front of their camera. Poses and
// points of `problem` are moved in place. `should_stop` may be empty; it is asked before each step.
BundleSolverResult SolveDenseSchur(const Camera& camera, const BundleSolverOptions& options,
                                   const std::function<bool()>& should_stop, const std::vector<uint8_t>& skip,
                                   BundleProblem* problem);

// The same by Ceres, which factorises a sparse system: for many poses.
BundleSolverResult SolveSparseSchur(const Camera& camera, const BundleSolverOptions& options,
                                    const std::function<bool()>& should_stop,
                                    const std::vector<uint8_t>& skip, BundleProblem* problem);

}  // namespace dynamic_slam
