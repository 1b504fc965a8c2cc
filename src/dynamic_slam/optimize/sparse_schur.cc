#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <memory>

#include <ceres/iteration_callback.h>
#include <ceres/loss_function.h>
#include <ceres/ordered_groups.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "dynamic_slam/optimize/bundle_solvers.h"
#include "dynamic_slam/optimize/reprojection_cost.h"

namespace dynamic_slam {
namespace {

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

using PoseBlock = std::array<double, kPoseBlockSize>;

PoseBlock ToBlock(const Rigid3& pose) {
  const Eigen::Quaterniond& q = pose.rotation;
  const Eigen::Vector3d& t = pose.translation;
  return {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
}

Rigid3 FromBlock(const PoseBlock& block) {
  return {Eigen::Quaterniond(block.data()), Eigen::Vector3d(block.data() + 4)};
}

}  // namespace

BundleSolverResult SolveSparseSchur(const Camera& camera, const BundleSolverOptions& options,
                                    const std::function<bool()>& should_stop,
                                    const std::vector<uint8_t>& skip, BundleProblem* problem) {
  std::vector<PoseBlock> poses;
  for (const BundleProblem::Pose& pose : problem->poses) poses.push_back(ToBlock(pose.cam_from_world));
  std::vector<Eigen::Vector3d> points;
  for (const BundleProblem::Point& point : problem->points) points.push_back(point.position);

  // One pool for each kind of object; Ceres would otherwise own, hash and free every one of them.
  std::deque<ReprojectionCost> costs;
  std::deque<WeightedHuberLoss> losses;
  std::deque<MotionCost> motions;
  PoseManifold manifold;
  const bool is_robust = std::isfinite(options.huber_chi2);
  WeightedHuberLoss loss_of_certain(1.0, options.huber_chi2);

  ceres::Problem::Options problem_options;
  problem_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.disable_all_safety_checks = true;
  ceres::Problem ceres_problem(problem_options);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();

  // What no observation reaches stays out of the problem.
  std::vector<uint8_t> has_pose(poses.size(), 0), has_point(points.size(), 0);
  for (size_t i = 0; i < skip.size(); ++i) {
    if (skip[i] != 0) continue;
    const BundleProblem::Observation& observation = problem->observations[i];
    const bool pose_fixed = problem->poses[observation.pose].fixed;
    const bool point_fixed = problem->points[observation.point].fixed;
    if (pose_fixed && point_fixed) continue;
    double* const pose = poses[observation.pose].data();
    double* const point = points[observation.point].data();
    if (has_pose[observation.pose] == 0) {
      has_pose[observation.pose] = 1;
      ceres_problem.AddParameterBlock(pose, kPoseBlockSize, &manifold);
      ordering->AddElementToGroup(pose, 1);
      if (pose_fixed) ceres_problem.SetParameterBlockConstant(pose);
    }
    if (has_point[observation.point] == 0) {
      has_point[observation.point] = 1;
      ceres_problem.AddParameterBlock(point, 3);
      ordering->AddElementToGroup(point, 0);  // points are eliminated first
      if (point_fixed) ceres_problem.SetParameterBlockConstant(point);
    }
    ceres::LossFunction* loss = is_robust ? &loss_of_certain : nullptr;
    if (observation.weight != 1.0) loss = &losses.emplace_back(observation.weight, options.huber_chi2);
    ceres_problem.AddResidualBlock(
        &costs.emplace_back(camera, observation.ideal_px, observation.inverse_sigma_px), loss, pose, point);
  }
  for (const BundleProblem::Motion& motion : problem->motions) {
    std::vector<double*> blocks;
    for (const uint32_t pose : motion.poses) {
      if (has_pose[pose] == 0) {
        has_pose[pose] = 1;
        ceres_problem.AddParameterBlock(poses[pose].data(), kPoseBlockSize, &manifold);
        ordering->AddElementToGroup(poses[pose].data(), 1);
        ceres_problem.SetParameterBlockConstant(poses[pose].data());  // what sees nothing does not move
      }
      blocks.push_back(poses[pose].data());
    }
    ceres_problem.AddResidualBlock(&motions.emplace_back(MotionFactors(motion)), nullptr, blocks);
  }
  BundleSolverResult result;
  result.usable = true;
  if (costs.empty()) return result;

  ceres::Solver::Options solver_options;
  solver_options.linear_solver_type = ceres::SPARSE_SCHUR;
  solver_options.linear_solver_ordering = std::move(ordering);
  solver_options.max_num_iterations = options.max_iterations;
  solver_options.function_tolerance = options.function_tolerance;
  solver_options.num_threads = options.num_threads;
  solver_options.logging_type = ceres::SILENT;
  StopCallback callback(should_stop);
  if (should_stop) solver_options.callbacks.push_back(&callback);

  ceres::Solver::Summary summary;
  ceres::Solve(solver_options, &ceres_problem, &summary);
  result.iterations = std::max(0, static_cast<int>(summary.iterations.size()) - 1);
  result.stopped = callback.stopped();
  result.usable = summary.IsSolutionUsable();
  if (!result.usable) return result;
  for (size_t i = 0; i < poses.size(); ++i) {
    if (has_pose[i] != 0 && !problem->poses[i].fixed) problem->poses[i].cam_from_world = FromBlock(poses[i]);
  }
  for (size_t i = 0; i < points.size(); ++i) {
    if (has_point[i] != 0 && !problem->points[i].fixed) problem->points[i].position = points[i];
  }
  return result;
}

}  // namespace dynamic_slam
