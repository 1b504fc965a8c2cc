#include "dynamic_slam/optimize/bundle_adjustment.h"

#include <array>
#include <cmath>
#include <deque>

#include <ceres/iteration_callback.h>
#include <ceres/loss_function.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/optimize/reprojection_cost.h"

namespace dynamic_slam {
namespace {

// Above this many free poses the reduced camera system is factorised sparsely.
constexpr int kMostPosesForDenseSchur = 100;

// weight * rho(s), rho being Huber's with its corner at s = delta_squared; s is a squared error in sigmas.
class WeightedHuberLoss final : public ceres::LossFunction {
 public:
  WeightedHuberLoss(double weight, double delta_squared) : weight_(weight), delta_squared_(delta_squared) {}

  void Evaluate(double s, double out[3]) const override {
    if (s <= delta_squared_) {
      out[0] = weight_ * s;
      out[1] = weight_;
      out[2] = 0;
      return;
    }
    const double slope = std::sqrt(delta_squared_ / s);
    out[0] = weight_ * (2.0 * s * slope - delta_squared_);
    out[1] = weight_ * slope;
    out[2] = -0.5 * weight_ * slope / s;
  }

 private:
  double weight_;
  double delta_squared_;
};

class StopCallback final : public ceres::IterationCallback {
 public:
  explicit StopCallback(const std::function<bool()>& should_stop) : should_stop_(should_stop) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    if (!stopped_ && !should_stop_()) return ceres::SOLVER_CONTINUE;
    stopped_ = true;
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }
  bool stopped() const { return stopped_; }

 private:
  const std::function<bool()>& should_stop_;
  bool stopped_ = false;
};

// The values under optimisation, in the blocks that Ceres works on, and the rounds over them.
class Adjuster {
 public:
  Adjuster(const Camera& camera, const BundleOptions& options, const std::function<bool()>& should_stop,
           const BundleProblem& problem);

  BundleSummary Run();

  // Copies the free values into `problem`; false, and nothing copied, if one is not finite.
  bool WriteBack(BundleProblem* problem) const;

  const std::vector<uint8_t>& is_outlier() const { return is_outlier_; }

 private:
  // Squared error in sigmas; infinity for a point that is not in front of the camera.
  double SquaredError(const BundleProblem::Observation& observation) const;
  bool IsUsable(const BundleProblem::Observation& observation) const;
  double RobustCost() const;
  void NameOutliers();

  // Minimises over the observations that are not outliers, until small steps or max_iterations. False: the
  // solver failed and the values are as before.
  bool Solve(bool robust, int max_iterations, BundleSummary* summary);

  const Camera& camera_;
  const BundleOptions& options_;
  const std::function<bool()>& should_stop_;
  const BundleProblem& problem_;
  std::vector<std::array<double, kPoseBlockSize>> poses_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<uint8_t> is_outlier_;
  std::vector<uint8_t> in_cost_;  // observations that RobustCost sums: the usable ones, in front at the start
};

Adjuster::Adjuster(const Camera& camera, const BundleOptions& options,
                   const std::function<bool()>& should_stop, const BundleProblem& problem)
    : camera_(camera), options_(options), should_stop_(should_stop), problem_(problem) {
  poses_.reserve(problem.poses.size());
  for (const BundleProblem::Pose& pose : problem.poses) {
    const Eigen::Quaterniond& q = pose.cam_from_world.rotation;
    const Eigen::Vector3d& t = pose.cam_from_world.translation;
    poses_.push_back({q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()});
  }
  points_.reserve(problem.points.size());
  for (const BundleProblem::Point& point : problem.points) points_.push_back(point.position);
  is_outlier_.reserve(problem.observations.size());
  for (const BundleProblem::Observation& observation : problem.observations) {
    is_outlier_.push_back(!IsUsable(observation) || !std::isfinite(SquaredError(observation)));
    in_cost_.push_back(!is_outlier_.back());
  }
}

double Adjuster::SquaredError(const BundleProblem::Observation& observation) const {
  const std::array<double, kPoseBlockSize>& pose = poses_[observation.pose];
  const Eigen::Vector3d x_in_cam =
      Eigen::Map<const Eigen::Quaterniond>(pose.data()) * points_[observation.point] +
      Eigen::Map<const Eigen::Vector3d>(pose.data() + 4);
  if (!(x_in_cam.z() > kMinProjectionDepth)) return std::numeric_limits<double>::infinity();
  const double error_px = (camera_.Project(x_in_cam) - observation.ideal_px).norm();
  return std::pow(error_px * observation.inverse_sigma_px, 2);
}

bool Adjuster::IsUsable(const BundleProblem::Observation& observation) const {
  return observation.weight > 0 && std::isfinite(observation.weight) && observation.inverse_sigma_px > 0 &&
         std::isfinite(observation.inverse_sigma_px) && observation.ideal_px.allFinite();
}

double Adjuster::RobustCost() const {
  double cost = 0;
  for (size_t i = 0; i < in_cost_.size(); ++i) {
    if (!in_cost_[i]) continue;
    const BundleProblem::Observation& observation = problem_.observations[i];
    const double most = std::pow(camera_.fx * observation.inverse_sigma_px, 2);  // for points now behind
    double rho[3];
    WeightedHuberLoss(observation.weight, options_.chi2)
        .Evaluate(std::min(SquaredError(observation), most), rho);
    cost += 0.5 * rho[0];
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
  // One pool for each kind of object; Ceres would otherwise own, hash and free every one of them.
  std::deque<ReprojectionCost> costs;
  std::deque<WeightedHuberLoss> losses;
  PoseManifold manifold;
  const double delta_squared = robust ? options_.chi2 : std::numeric_limits<double>::infinity();
  WeightedHuberLoss loss_of_certain(1.0, delta_squared);

  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.disable_all_safety_checks = true;
  ceres::Problem ceres_problem(problem_options);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();

  // 1: a free value that an observation reaches, 2: a fixed one. What none reaches stays out of the problem.
  std::vector<uint8_t> pose_role(poses_.size(), 0), point_role(points_.size(), 0);
  int free_poses = 0;
  for (size_t i = 0; i < is_outlier_.size(); ++i) {
    if (is_outlier_[i]) continue;
    const BundleProblem::Observation& observation = problem_.observations[i];
    const bool pose_fixed = problem_.poses[observation.pose].fixed;
    const bool point_fixed = problem_.points[observation.point].fixed;
    if (pose_fixed && point_fixed) continue;
    double* const pose = poses_[observation.pose].data();
    double* const point = points_[observation.point].data();
    if (pose_role[observation.pose] == 0) {
      pose_role[observation.pose] = pose_fixed ? 2 : 1;
      ceres_problem.AddParameterBlock(pose, kPoseBlockSize, &manifold);
      ordering->AddElementToGroup(pose, 1);
      if (pose_fixed) ceres_problem.SetParameterBlockConstant(pose);
      free_poses += !pose_fixed;
    }
    if (point_role[observation.point] == 0) {
      point_role[observation.point] = point_fixed ? 2 : 1;
      ceres_problem.AddParameterBlock(point, 3);
      ordering->AddElementToGroup(point, 0);  // points are eliminated first
      if (point_fixed) ceres_problem.SetParameterBlockConstant(point);
    }
    ceres::LossFunction* loss = robust ? &loss_of_certain : nullptr;
    if (observation.weight != 1.0) loss = &losses.emplace_back(observation.weight, delta_squared);
    ceres_problem.AddResidualBlock(
        &costs.emplace_back(camera_, observation.ideal_px, observation.inverse_sigma_px), loss, pose, point);
  }
  if (costs.empty()) return true;

  ceres::Solver::Options solver_options;
  solver_options.linear_solver_type =
      free_poses <= kMostPosesForDenseSchur ? ceres::DENSE_SCHUR : ceres::SPARSE_SCHUR;
  solver_options.linear_solver_ordering = std::move(ordering);
  solver_options.max_num_iterations = max_iterations;
  solver_options.function_tolerance = options_.function_tolerance;
  solver_options.num_threads = options_.num_threads;
  solver_options.logging_type = ceres::SILENT;
  StopCallback callback(should_stop_);
  if (should_stop_) solver_options.callbacks.push_back(&callback);

  ceres::Solver::Summary result;
  ceres::Solve(solver_options, &ceres_problem, &result);
  summary->iterations += std::max(0, static_cast<int>(result.iterations.size()) - 1);
  summary->stopped = callback.stopped();
  return result.IsSolutionUsable();
}

BundleSummary Adjuster::Run() {
  BundleSummary summary;
  summary.initial_cost = RobustCost();
  summary.usable = Solve(/*robust=*/true, options_.max_iterations, &summary);
  NameOutliers();
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
  std::vector<Rigid3> poses;
  poses.reserve(poses_.size());
  for (size_t i = 0; i < poses_.size(); ++i) {
    poses.emplace_back(Eigen::Quaterniond(poses_[i].data()), Eigen::Vector3d(poses_[i].data() + 4));
    if (!problem->poses[i].fixed && !poses.back().IsFinite()) return false;
  }
  for (size_t i = 0; i < points_.size(); ++i) {
    if (!problem->points[i].fixed && !points_[i].allFinite()) return false;
  }
  for (size_t i = 0; i < poses.size(); ++i) {
    if (!problem->poses[i].fixed) problem->poses[i].cam_from_world = poses[i];
  }
  for (size_t i = 0; i < points_.size(); ++i) {
    if (!problem->points[i].fixed) problem->points[i].position = points_[i];
  }
  return true;
}

}  // namespace

BundleSummary AdjustBundle(const Camera& camera, const BundleOptions& options,
                           const std::function<bool()>& should_stop, BundleProblem* problem,
                           std::vector<uint8_t>* is_outlier) {
  DS_CHECK(problem != nullptr && is_outlier != nullptr);
  bool any_fixed = false;
  for (const BundleProblem::Pose& pose : problem->poses) any_fixed |= pose.fixed;
  DS_CHECK(any_fixed, "poses={}: none is fixed, so the world could drift", problem->poses.size());
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
