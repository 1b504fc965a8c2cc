#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/optimize/bundle_solvers.h"
#include "dynamic_slam/optimize/reprojection_cost.h"

namespace dynamic_slam {
namespace {

constexpr uint32_t kFixed = std::numeric_limits<uint32_t>::max();

// Rows of 6 numbers are padded to 8, so that they are whole vectors.
constexpr int kRow = 8;
constexpr int kCouplingSize = 3 * kRow;  // a point's 3 rows of a pose's 6 columns
constexpr int kPoseBlock = 6 * kRow;     // a pose's 6 rows of another's 6 columns

// Damping as in Madsen, Nielsen and Tingleff, "Methods for non-linear least squares problems" (2004),
// section 3.2: the diagonal over the radius.
constexpr double kInitialRadius = 1e4;
constexpr double kMinRadius = 1e-12;
constexpr double kMinGainRatio = 1e-3;  // of a step that is taken
constexpr double kMinDiagonal = 1e-6, kMaxDiagonal = 1e32;

// What one observation says, in the order of the points.
struct Row {
  uint32_t pose;  // in the problem
  uint32_t slot;  // of the free pose, or kFixed
  double u, v, inverse_sigma, weight;
};

// Always inlined: a function of its own would be compiled for the plain processor only (base/dispatch.h).

// block -= y^T w, of two couplings.
__attribute__((always_inline)) inline void SubtractProduct(const double* __restrict y,
                                                           const double* __restrict w,
                                                           double* __restrict block) {
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < kRow; ++j) {
      block[i * kRow + j] -= y[i] * w[j] + y[kRow + i] * w[kRow + j] + y[2 * kRow + i] * w[2 * kRow + j];
    }
  }
}

// y = inverse * w, of a coupling.
__attribute__((always_inline)) inline void Scale(const Eigen::Matrix3d& inverse, const double* __restrict w,
                                                 double* __restrict y) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < kRow; ++c) {
      y[r * kRow + c] = inverse(r, 0) * w[c] + inverse(r, 1) * w[kRow + c] + inverse(r, 2) * w[2 * kRow + c];
    }
  }
}

// For one point, of which `inverse` is the inverse Hessian: reduces the blocks of every pair of its poses,
// which are in ascending order. scaled: room for as many couplings.
DS_DISPATCH_AVX2
void ReducePairs(const Eigen::Matrix3d& inverse, const double* couplings, const uint32_t* slots,
                 uint32_t count, uint32_t poses, double* scaled, double* blocks) {
  for (uint32_t k = 0; k < count; ++k) {
    Scale(inverse, couplings + k * kCouplingSize, scaled + k * kCouplingSize);
  }
  for (uint32_t a = 0; a < count; ++a) {
    for (uint32_t b = a; b < count; ++b) {
      SubtractProduct(scaled + a * kCouplingSize, couplings + b * kCouplingSize,
                      blocks + (static_cast<size_t>(slots[a]) * poses + slots[b]) * kPoseBlock);
      // Two sightings of the point by one pose.
      if (a != b && slots[a] == slots[b]) {
        SubtractProduct(scaled + b * kCouplingSize, couplings + a * kCouplingSize,
                        blocks + (static_cast<size_t>(slots[a]) * poses + slots[b]) * kPoseBlock);
      }
    }
  }
}

class DenseSchur {
 public:
  DenseSchur(const Camera& camera, const BundleSolverOptions& options, const std::vector<uint8_t>& skip,
             BundleProblem* problem);

  BundleSolverResult Run(const std::function<bool()>& should_stop);

 private:
  struct PoseValue {
    Eigen::Quaterniond rotation;
    Eigen::Matrix3d matrix;
    Eigen::Vector3d translation;
  };
  struct PointSystem {
    Eigen::Matrix3d hessian;
    Eigen::Vector3d gradient;
  };

  bool IsFreePoint(size_t point) const {
    return !problem_->points[point].fixed && begin_[point] < begin_[point + 1];
  }
  Eigen::Vector3d ChangeOfVelocity(const BundleProblem::Motion& motion,
                                   const std::vector<PoseValue>& poses) const;
  void LineariseMotions();
  // What the motions couple, into blocks_.
  void CoupleMotions();
  double Loss(double squared_error, double weight, double* slope) const;
  double Cost(const std::vector<PoseValue>& poses, const std::vector<Eigen::Vector3d>& points) const;
  void Linearise();
  // The step at this damping, into step_poses_ and step_points_; false when the system is not positive
  // definite.
  bool Solve(double radius);
  double PredictedGain(double radius) const;
  void MakeTrial();

  const Camera& camera_;
  const BundleSolverOptions& options_;
  BundleProblem* problem_;
  std::vector<Row> rows_;        // by point, there by slot: those of fixed poses are the last
  std::vector<uint32_t> begin_;  // of each point's rows, and the end
  uint32_t free_poses_ = 0;
  std::vector<uint32_t> pose_of_slot_, slot_of_pose_;

  std::vector<PoseValue> poses_, trial_poses_;
  std::vector<Eigen::Vector3d> points_, trial_points_;

  // The normal equations: of poses, of points, and what couples them, a 3 x 6 for each row of a free point
  // and a free pose.
  std::vector<double> pose_hessians_;
  Eigen::VectorXd pose_gradient_;
  std::vector<PointSystem> point_systems_;
  std::vector<uint32_t> coupling_begin_;  // of each point's couplings, and the end
  std::vector<uint32_t> slots_;           // of each coupling
  std::unique_ptr<double[]> couplings_;

  std::vector<Eigen::Matrix3d> inverse_hessians_;  // of the damped points
  std::vector<double> blocks_, scaled_;
  Eigen::VectorXd step_poses_;
  std::vector<Eigen::Vector3d> step_points_;
};

DenseSchur::DenseSchur(const Camera& camera, const BundleSolverOptions& options,
                       const std::vector<uint8_t>& skip, BundleProblem* problem)
    : camera_(camera), options_(options), problem_(problem) {
  const size_t points = problem->points.size();
  begin_.assign(points + 1, 0);
  slot_of_pose_.assign(problem->poses.size(), kFixed);
  for (size_t i = 0; i < skip.size(); ++i) {
    if (skip[i] != 0) continue;
    const BundleProblem::Observation& observation = problem->observations[i];
    ++begin_[observation.point + 1];
    if (!problem->poses[observation.pose].fixed) slot_of_pose_[observation.pose] = 0;
  }
  for (size_t i = 0; i < points; ++i) begin_[i + 1] += begin_[i];
  for (uint32_t pose = 0; pose < slot_of_pose_.size(); ++pose) {
    if (slot_of_pose_[pose] == kFixed) continue;
    slot_of_pose_[pose] = free_poses_++;
    pose_of_slot_.push_back(pose);
  }
  rows_.resize(begin_.back());
  std::vector<uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (size_t i = 0; i < skip.size(); ++i) {
    if (skip[i] != 0) continue;
    const BundleProblem::Observation& observation = problem->observations[i];
    rows_[next[observation.point]++] = {
        observation.pose,         slot_of_pose_[observation.pose], observation.ideal_px.x(),
        observation.ideal_px.y(), observation.inverse_sigma_px,    observation.weight};
  }
  for (size_t i = 0; i < points; ++i) {
    std::stable_sort(rows_.begin() + begin_[i], rows_.begin() + begin_[i + 1],
                     [](const Row& a, const Row& b) { return a.slot < b.slot; });
  }
  for (const BundleProblem::Pose& pose : problem->poses) {
    poses_.push_back(
        {pose.cam_from_world.rotation, pose.cam_from_world.Matrix(), pose.cam_from_world.translation});
  }
  for (const BundleProblem::Point& point : problem->points) points_.push_back(point.position);
  trial_poses_ = poses_;
  trial_points_ = points_;
  pose_hessians_.resize(static_cast<size_t>(free_poses_) * 36);
  pose_gradient_.resize(6 * free_poses_);
  point_systems_.resize(points);
  inverse_hessians_.resize(points);
  step_points_.resize(points);
  size_t most_couplings = 0;
  coupling_begin_.push_back(0);
  for (size_t i = 0; i < points; ++i) {
    for (uint32_t k = begin_[i]; IsFreePoint(i) && k < begin_[i + 1] && rows_[k].slot != kFixed; ++k) {
      slots_.push_back(rows_[k].slot);
    }
    most_couplings = std::max(most_couplings, slots_.size() - coupling_begin_.back());
    coupling_begin_.push_back(static_cast<uint32_t>(slots_.size()));
  }
  couplings_ = std::make_unique_for_overwrite<double[]>(slots_.size() * kCouplingSize);
  scaled_.resize(most_couplings * kCouplingSize);
  blocks_.resize(static_cast<size_t>(free_poses_) * free_poses_ * kPoseBlock);
}

double DenseSchur::Loss(double squared_error, double weight, double* slope) const {
  *slope =
      squared_error <= options_.huber_chi2 ? weight : weight * std::sqrt(options_.huber_chi2 / squared_error);
  return weight * HuberLoss(squared_error, options_.huber_chi2);
}

double DenseSchur::Cost(const std::vector<PoseValue>& poses,
                        const std::vector<Eigen::Vector3d>& points) const {
  double cost = 0, slope = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    for (uint32_t k = begin_[i]; k < begin_[i + 1]; ++k) {
      const Row& row = rows_[k];
      const PoseValue& pose = poses[row.pose];
      const Eigen::Vector3d x = pose.matrix * points[i] + pose.translation;
      // As if at this depth: the error becomes huge but finite.
      const double inverse_z = 1.0 / std::max(x.z(), kMinProjectionDepth);
      const double ru = (camera_.fx * x.x() * inverse_z + camera_.cx - row.u) * row.inverse_sigma;
      const double rv = (camera_.fy * x.y() * inverse_z + camera_.cy - row.v) * row.inverse_sigma;
      cost += Loss(ru * ru + rv * rv, row.weight, &slope);
    }
  }
  for (const BundleProblem::Motion& motion : problem_->motions) {
    cost += ChangeOfVelocity(motion, poses).squaredNorm();
  }
  return 0.5 * cost;
}

Eigen::Vector3d DenseSchur::ChangeOfVelocity(const BundleProblem::Motion& motion,
                                             const std::vector<PoseValue>& poses) const {
  const std::array<Eigen::Matrix3d, 3> factors = MotionFactors(motion);
  Eigen::Vector3d change = Eigen::Vector3d::Zero();
  for (size_t k = 0; k < factors.size(); ++k) {
    const PoseValue& pose = poses[motion.poses[k]];
    change -= factors[k] * (pose.matrix.transpose() * pose.translation);
  }
  return change;
}

// The centre -R^T t moves by -R^T v with an increment (rotation w, translation v) from the left, whatever w
// is.
void DenseSchur::LineariseMotions() {
  for (const BundleProblem::Motion& motion : problem_->motions) {
    const std::array<Eigen::Matrix3d, 3> factors = MotionFactors(motion);
    const Eigen::Vector3d change = ChangeOfVelocity(motion, poses_);
    for (size_t k = 0; k < factors.size(); ++k) {
      const uint32_t slot = slot_of_pose_[motion.poses[k]];
      if (slot == kFixed) continue;
      const Eigen::Matrix3d along = factors[k] * poses_[motion.poses[k]].matrix.transpose();
      Eigen::Map<Eigen::Matrix<double, 6, 6>>(&pose_hessians_[36 * slot]).bottomRightCorner<3, 3>() +=
          along.transpose() * along;
      pose_gradient_.segment<3>(6 * slot + 3) -= along.transpose() * change;
    }
  }
}

void DenseSchur::CoupleMotions() {
  for (const BundleProblem::Motion& motion : problem_->motions) {
    const std::array<Eigen::Matrix3d, 3> factors = MotionFactors(motion);
    for (size_t k = 0; k < factors.size(); ++k) {
      for (size_t l = 0; l < factors.size(); ++l) {
        const uint32_t a = slot_of_pose_[motion.poses[k]], b = slot_of_pose_[motion.poses[l]];
        if (a >= b || b == kFixed) continue;
        const Eigen::Matrix3d coupling = poses_[motion.poses[k]].matrix * factors[k].transpose() *
                                         factors[l] * poses_[motion.poses[l]].matrix.transpose();
        double* block = &blocks_[(static_cast<size_t>(a) * free_poses_ + b) * kPoseBlock];
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j) block[(3 + i) * kRow + 3 + j] += coupling(i, j);
        }
      }
    }
  }
}

void DenseSchur::Linearise() {
  std::fill(pose_hessians_.begin(), pose_hessians_.end(), 0.0);
  pose_gradient_.setZero();
  for (size_t i = 0; i < points_.size(); ++i) {
    PointSystem& system = point_systems_[i];
    system.hessian.setZero();
    system.gradient.setZero();
    const bool is_free = !problem_->points[i].fixed;
    for (uint32_t k = begin_[i]; k < begin_[i + 1]; ++k) {
      const Row& row = rows_[k];
      const PoseValue& pose = poses_[row.pose];
      const Eigen::Vector3d x = pose.matrix * points_[i] + pose.translation;
      const bool in_front = x.z() > kMinProjectionDepth;
      const double inverse_z = 1.0 / std::max(x.z(), kMinProjectionDepth);
      const double a = x.x() * inverse_z, b = x.y() * inverse_z;
      const double su = camera_.fx * row.inverse_sigma, sv = camera_.fy * row.inverse_sigma;
      const Eigen::Vector2d residual(su * a + (camera_.cx - row.u) * row.inverse_sigma,
                                     sv * b + (camera_.cy - row.v) * row.inverse_sigma);
      double slope = 0;
      Loss(residual.squaredNorm(), row.weight, &slope);

      Eigen::Matrix<double, 2, 3> J_cam;                                 // of x_in_cam
      J_cam << su * inverse_z, 0, in_front ? -su * a * inverse_z : 0.0,  //
          0, sv * inverse_z, in_front ? -sv * b * inverse_z : 0.0;
      const Eigen::Matrix<double, 2, 3> J_point = J_cam * pose.matrix;
      const Eigen::Matrix<double, 2, 3> weighted = slope * J_point;
      if (is_free) {
        system.hessian.noalias() += J_point.transpose() * weighted;
        system.gradient.noalias() += weighted.transpose() * residual;
      }
      if (row.slot == kFixed) continue;
      // x -> Exp(rotation) x + translation
      Eigen::Matrix<double, 2, 6> J_pose;
      J_pose.leftCols<3>() = -J_cam * Skew(x);
      J_pose.rightCols<3>() = J_cam;
      Eigen::Map<Eigen::Matrix<double, 6, 6>> hessian(&pose_hessians_[36 * row.slot]);
      const Eigen::Matrix<double, 2, 6> weighted_pose = slope * J_pose;
      hessian.noalias() += J_pose.transpose() * weighted_pose;
      pose_gradient_.segment<6>(6 * row.slot).noalias() += weighted_pose.transpose() * residual;
      if (!is_free) continue;
      double* coupling = &couplings_[size_t{coupling_begin_[i] + (k - begin_[i])} * kCouplingSize];
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 6; ++c) {
          coupling[r * kRow + c] = weighted(0, r) * J_pose(0, c) + weighted(1, r) * J_pose(1, c);
        }
        coupling[r * kRow + 6] = coupling[r * kRow + 7] = 0;
      }
    }
  }
  LineariseMotions();
}

double Damping(double diagonal, double radius) {
  return std::clamp(diagonal, kMinDiagonal, kMaxDiagonal) / radius;
}

bool DenseSchur::Solve(double radius) {
  std::fill(blocks_.begin(), blocks_.end(), 0.0);
  Eigen::VectorXd right = -pose_gradient_;
  for (size_t i = 0; i < points_.size(); ++i) {
    if (!IsFreePoint(i)) continue;
    Eigen::Matrix3d damped = point_systems_[i].hessian;
    for (int d = 0; d < 3; ++d) damped(d, d) += Damping(damped(d, d), radius);
    inverse_hessians_[i] = damped.inverse();
    const Eigen::Matrix3d& inverse = inverse_hessians_[i];
    const Eigen::Vector3d shift = inverse * point_systems_[i].gradient;

    const uint32_t count = coupling_begin_[i + 1] - coupling_begin_[i];
    const double* couplings = couplings_.get() + size_t{coupling_begin_[i]} * kCouplingSize;
    const uint32_t* slots = slots_.data() + coupling_begin_[i];
    for (uint32_t k = 0; k < count; ++k) {
      const double* w = couplings + k * kCouplingSize;
      for (int c = 0; c < 6; ++c) {
        right[6 * slots[k] + c] += w[c] * shift[0] + w[kRow + c] * shift[1] + w[2 * kRow + c] * shift[2];
      }
    }
    ReducePairs(inverse, couplings, slots, count, free_poses_, scaled_.data(), blocks_.data());
  }
  CoupleMotions();
  if (free_poses_ > 0) {
    const Eigen::Index size = 6 * static_cast<Eigen::Index>(free_poses_);
    Eigen::MatrixXd reduced(size, size);  // the lower triangle
    for (uint32_t a = 0; a < free_poses_; ++a) {
      for (uint32_t b = a; b < free_poses_; ++b) {
        const double* block = &blocks_[(static_cast<size_t>(a) * free_poses_ + b) * kPoseBlock];
        for (int i = 0; i < 6; ++i) {
          for (int j = 0; j < 6; ++j) reduced(6 * b + j, 6 * a + i) = block[i * kRow + j];
        }
      }
      const Eigen::Map<const Eigen::Matrix<double, 6, 6>> hessian(&pose_hessians_[36 * a]);
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) reduced(6 * a + j, 6 * a + i) += hessian(j, i);
        reduced(6 * a + i, 6 * a + i) += Damping(hessian(i, i), radius);
      }
    }
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>, Eigen::Lower> factor(reduced);
    if (factor.info() != Eigen::Success) return false;
    step_poses_ = factor.solve(right);
    if (!step_poses_.allFinite()) return false;
  }
  for (size_t i = 0; i < points_.size(); ++i) {
    step_points_[i].setZero();
    if (!IsFreePoint(i)) continue;
    Eigen::Vector3d rest = -point_systems_[i].gradient;
    for (uint32_t k = coupling_begin_[i]; k < coupling_begin_[i + 1]; ++k) {
      const double* w = &couplings_[size_t{k} * kCouplingSize];
      const double* step = &step_poses_[6 * slots_[k]];
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 6; ++c) rest[r] -= w[r * kRow + c] * step[c];
      }
    }
    step_points_[i] = inverse_hessians_[i] * rest;
    if (!step_points_[i].allFinite()) return false;
  }
  return true;
}

// By how much the linearised cost falls: with (H + D) step = -g, that is 1/2 (step D step - step g).
double DenseSchur::PredictedGain(double radius) const {
  double gain = 0;
  for (uint32_t slot = 0; slot < free_poses_; ++slot) {
    for (int i = 0; i < 6; ++i) {
      const double step = step_poses_[6 * slot + i];
      gain +=
          step * (step * Damping(pose_hessians_[36 * slot + 7 * i], radius) - pose_gradient_[6 * slot + i]);
    }
  }
  for (size_t i = 0; i < points_.size(); ++i) {
    if (!IsFreePoint(i)) continue;
    for (int d = 0; d < 3; ++d) {
      const double step = step_points_[i][d];
      gain +=
          step * (step * Damping(point_systems_[i].hessian(d, d), radius) - point_systems_[i].gradient[d]);
    }
  }
  return 0.5 * gain;
}

void DenseSchur::MakeTrial() {
  for (uint32_t slot = 0; slot < free_poses_; ++slot) {
    const PoseValue& pose = poses_[pose_of_slot_[slot]];
    PoseValue& trial = trial_poses_[pose_of_slot_[slot]];
    const Eigen::Quaterniond turn = ExpSo3(step_poses_.segment<3>(6 * slot));
    trial.rotation = (turn * pose.rotation).normalized();
    trial.matrix = trial.rotation.toRotationMatrix();
    trial.translation = turn * pose.translation + step_poses_.segment<3>(6 * slot + 3);
  }
  for (size_t i = 0; i < points_.size(); ++i) trial_points_[i] = points_[i] + step_points_[i];
}

BundleSolverResult DenseSchur::Run(const std::function<bool()>& should_stop) {
  BundleSolverResult result;
  result.usable = true;
  if (rows_.empty()) return result;
  double cost = Cost(poses_, points_);
  double radius = kInitialRadius, shrink = 2;
  bool is_linearised = false;
  while (result.iterations < options_.max_iterations) {
    if (should_stop && should_stop()) {
      result.stopped = true;
      break;
    }
    if (!is_linearised) Linearise();
    is_linearised = true;
    ++result.iterations;
    double gain = 0, gain_ratio = 0, trial_cost = 0;
    if (Solve(radius)) {
      MakeTrial();
      trial_cost = Cost(trial_poses_, trial_points_);
      gain = cost - trial_cost;
      gain_ratio = gain / PredictedGain(radius);
    }
    if (std::isfinite(gain_ratio) && gain > 0 && gain_ratio > kMinGainRatio) {
      poses_.swap(trial_poses_);
      points_.swap(trial_points_);
      is_linearised = false;
      radius /= std::max(1.0 / 3.0, 1.0 - std::pow(2 * gain_ratio - 1, 3));
      shrink = 2;
      const bool has_converged = gain < options_.function_tolerance * cost;
      cost = trial_cost;
      if (has_converged) break;
    } else {
      // No step helps any more, if a tiny one is all that the linearisation promises.
      if (std::abs(gain) <= options_.function_tolerance * cost && gain_ratio != 0) break;
      radius /= shrink;
      shrink *= 2;
      if (radius < kMinRadius) break;
    }
  }
  for (const uint32_t pose : pose_of_slot_) {
    problem_->poses[pose].cam_from_world = Rigid3(poses_[pose].rotation, poses_[pose].translation);
  }
  for (size_t i = 0; i < points_.size(); ++i) {
    if (IsFreePoint(i)) problem_->points[i].position = points_[i];
  }
  return result;
}

}  // namespace

BundleSolverResult SolveDenseSchur(const Camera& camera, const BundleSolverOptions& options,
                                   const std::function<bool()>& should_stop, const std::vector<uint8_t>& skip,
                                   BundleProblem* problem) {
  return DenseSchur(camera, options, skip, problem).Run(should_stop);
}

}  // namespace dynamic_slam
