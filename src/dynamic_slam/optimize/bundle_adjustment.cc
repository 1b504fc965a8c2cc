#include "dynamic_slam/optimize/bundle_adjustment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/optimize/bundle_solvers.h"
#include "dynamic_slam/optimize/reprojection_cost.h"

namespace dynamic_slam {
namespace {

// Above this many free poses the reduced camera system is factorised sparsely. Ceres takes more memory: with
// 284 poses of fr1_desk 207 MB at its peak instead of 176, and as much time.
constexpr int kMostPosesForDenseSchur = 400;

// The rounds of an adjustment, on a copy of the problem.
class Adjuster {
 public:
  Adjuster(const Camera& camera, const BundleOptions& options, const std::function<bool()>& should_stop,
           const BundleProblem& problem);

  BundleSummary Run();

  // Copies the values into `problem`; false, and nothing copied, if one that was free is not finite.
  bool WriteBack(BundleProblem* problem) const;

  const std::vector<uint8_t>& is_outlier() const { return is_outlier_; }

 private:
  // Squared error in sigmas; infinity for a point that is not in front of the camera.
  double SquaredError(const BundleProblem::Observation& observation) const;
  bool IsUsable(const BundleProblem::Observation& observation) const;
  double RobustCost() const;
  void NameOutliers();

  // Minimises over the observations that are not outliers. False: the solver failed, the values are as
  // before.
  bool Solve(bool robust, int max_iterations, BundleSummary* summary);

  const Camera& camera_;
  const BundleOptions& options_;
  const std::function<bool()>& should_stop_;
  BundleProblem problem_;
  std::vector<uint8_t> is_outlier_;
  std::vector<uint8_t> in_cost_;  // observations that RobustCost sums: the usable ones, in front at the start
};

Adjuster::Adjuster(const Camera& camera, const BundleOptions& options,
                   const std::function<bool()>& should_stop, const BundleProblem& problem)
    : camera_(camera), options_(options), should_stop_(should_stop), problem_(problem) {
  is_outlier_.reserve(problem.observations.size());
  for (const BundleProblem::Observation& observation : problem.observations) {
    is_outlier_.push_back(!IsUsable(observation) || !std::isfinite(SquaredError(observation)));
    in_cost_.push_back(!is_outlier_.back());
  }
}

double Adjuster::SquaredError(const BundleProblem::Observation& observation) const {
  const Eigen::Vector3d x_in_cam =
      problem_.poses[observation.pose].cam_from_world * problem_.points[observation.point].position;
  if (!(x_in_cam.z() > kMinProjectionDepth)) return std::numeric_limits<double>::infinity();
  return (camera_.Project(x_in_cam) - observation.ideal_px).squaredNorm() * observation.inverse_sigma_px *
         observation.inverse_sigma_px;
}

bool Adjuster::IsUsable(const BundleProblem::Observation& observation) const {
  return observation.weight > 0 && std::isfinite(observation.weight) && observation.inverse_sigma_px > 0 &&
         std::isfinite(observation.inverse_sigma_px) && observation.ideal_px.allFinite();
}

double Adjuster::RobustCost() const {
  double cost = 0;
  for (size_t i = 0; i < in_cost_.size(); ++i) {
    if (in_cost_[i] == 0) continue;
    const BundleProblem::Observation& observation = problem_.observations[i];
    const double most = std::pow(camera_.fx * observation.inverse_sigma_px, 2);  // for points now behind
    cost += 0.5 * observation.weight * HuberLoss(std::min(SquaredError(observation), most), options_.chi2);
  }
  return cost;
}

void Adjuster::NameOutliers() {
  for (size_t i = 0; i < is_outlier_.size(); ++i) {
    const BundleProblem::Observation& observation = problem_.observations[i];
    is_outlier_[i] = !IsUsable(observation) || !(SquaredError(observation) <= options_.chi2);
  }
}

bool Adjuster::Solve(bool robust, int max_iterations, BundleSummary* summary) {
  BundleSolverOptions options;
  options.huber_chi2 = robust ? options_.chi2 : std::numeric_limits<double>::infinity();
  options.max_iterations = max_iterations;
  options.function_tolerance = options_.function_tolerance;
  options.num_threads = options_.num_threads;
  int free_poses = 0;
  for (const BundleProblem::Pose& pose : problem_.poses) free_poses += !pose.fixed;
  const auto solve = free_poses <= kMostPosesForDenseSchur ? SolveDenseSchur : SolveSparseSchur;
  const BundleSolverResult result = solve(camera_, options, should_stop_, is_outlier_, &problem_);
  summary->iterations += result.iterations;
  summary->stopped = result.stopped;
  return result.usable;
}

BundleSummary Adjuster::Run() {
  BundleSummary summary;
  summary.initial_cost = RobustCost();
  summary.usable = Solve(/*robust=*/true, options_.max_iterations, &summary);
  // Before its first step the problem may be far from what it becomes: nothing is known of any observation
  // yet.
  if (!summary.stopped || summary.iterations > 0) NameOutliers();
  if (summary.usable && !summary.stopped && options_.reject_outliers && options_.refine_iterations > 0) {
    // If this round fails, the values of the first one stand.
    Solve(/*robust=*/false, options_.refine_iterations, &summary);
    NameOutliers();
  }
  summary.final_cost = RobustCost();
  for (const uint8_t outlier : is_outlier_) summary.outliers += outlier;
  return summary;
}

bool Adjuster::WriteBack(BundleProblem* problem) const {
  for (const BundleProblem::Pose& pose : problem_.poses) {
    if (!pose.fixed && !pose.cam_from_world.IsFinite()) return false;
  }
  for (const BundleProblem::Point& point : problem_.points) {
    if (!point.fixed && !point.position.allFinite()) return false;
  }
  problem->poses = problem_.poses;
  problem->points = problem_.points;
  return true;
}

}  // namespace

BundleSummary AdjustBundle(const Camera& camera, const BundleOptions& options,
                           const std::function<bool()>& should_stop, BundleProblem* problem,
                           std::vector<uint8_t>* is_outlier) {
  DS_CHECK(problem != nullptr && is_outlier != nullptr);
  const auto is_fixed = [](const auto& part) { return part.fixed; };
  DS_CHECK(
      std::ranges::any_of(problem->poses, is_fixed) ||
          static_cast<size_t>(std::ranges::count_if(problem->points, is_fixed)) >= kFewestPointsToHoldWorld,
      "poses={} points={}: too few are fixed, so the world could drift", problem->poses.size(),
      problem->points.size());
  for (const BundleProblem::Observation& observation : problem->observations) {
    DS_CHECK(observation.pose < problem->poses.size() && observation.point < problem->points.size(),
             "pose={} of {} point={} of {}", observation.pose, problem->poses.size(), observation.point,
             problem->points.size());
  }

  Adjuster adjuster(camera, options, should_stop, *problem);
  BundleSummary summary = adjuster.Run();
  summary.usable = summary.usable && adjuster.WriteBack(problem);
  *is_outlier = adjuster.is_outlier();
  return summary;
}

}  // namespace dynamic_slam
