#pragma once

#include <algorithm>
#include <array>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// A pose is one block of 7 numbers for Ceres: quaternion (x, y, z, w), then translation, of cam_from_world.
inline constexpr int kPoseBlockSize = 7;

// Points nearer than this (or behind the camera) are projected as if at this depth, in units of the map: the
// error becomes huge but finite, so the solver refuses the step that led there.
inline constexpr double kMinProjectionDepth = 1e-4;

// The pose block moves by increments from the left, (rotation vector, translation):
// x_in_cam -> Exp(rotation) * x_in_cam + translation. Turning about the camera rather than about the world's
// origin keeps rotation and translation apart however far the camera has travelled.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return kPoseBlockSize; }
  int TangentSize() const override { return 6; }

  bool Plus(const double* pose, const double* increment, double* pose_plus) const override {
    const Eigen::Map<const Eigen::Quaterniond> q(pose);
    const Eigen::Map<const Eigen::Vector3d> t(pose + 4), rotation(increment), translation(increment + 3);
    const Eigen::Quaterniond turn = ExpSo3(rotation);
    Eigen::Map<Eigen::Quaterniond> q_plus(pose_plus);
    Eigen::Map<Eigen::Vector3d> t_plus(pose_plus + 4);
    q_plus = (turn * q).normalized();
    t_plus = turn * t + translation;
    return true;
  }

  // 7 x 6, row-major: d Plus / d increment at 0.
  bool PlusJacobian(const double* pose, double* jacobian) const override {
    const Eigen::Map<const Eigen::Quaterniond> q(pose);
    const Eigen::Map<const Eigen::Vector3d> t(pose + 4);
    Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> J(jacobian);
    J.setZero();
    // (rotation / 2, 1) * q = q + 1/2 (w r + r x v, -r . v)
    J.block<3, 3>(0, 0) = 0.5 * (q.w() * Eigen::Matrix3d::Identity() - Skew(q.vec()));
    J.block<1, 3>(3, 0) = -0.5 * q.vec().transpose();
    J.block<3, 3>(4, 0) = -Skew(t);
    J.block<3, 3>(4, 3).setIdentity();
    return true;
  }

  bool Minus(const double* pose_plus, const double* pose, double* increment) const override {
    const Eigen::Map<const Eigen::Quaterniond> q(pose), q_plus(pose_plus);
    const Eigen::Map<const Eigen::Vector3d> t(pose + 4), t_plus(pose_plus + 4);
    const Eigen::Quaterniond turn = q_plus * q.conjugate();
    Eigen::Map<Eigen::Vector3d> rotation(increment), translation(increment + 3);
    rotation = LogSo3(turn);
    translation = t_plus - turn * t;
    return true;
  }

  // 6 x 7, row-major: d Minus(pose_plus, pose) / d pose_plus at pose_plus = pose.
  bool MinusJacobian(const double* pose, double* jacobian) const override {
    const Eigen::Map<const Eigen::Quaterniond> q(pose);
    const Eigen::Map<const Eigen::Vector3d> t(pose + 4);
    Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> J(jacobian);
    J.setZero();
    // rotation = 2 vec(q_plus * conjugate(q)), to first order
    J.block<3, 3>(0, 0) = 2.0 * (q.w() * Eigen::Matrix3d::Identity() + Skew(q.vec()));
    J.block<3, 1>(0, 3) = -2.0 * q.vec();
    J.block<3, 4>(3, 0) = Skew(t) * J.block<3, 4>(0, 0);
    J.block<3, 3>(3, 4).setIdentity();
    return true;
  }
};

// Reprojection error of a point in one image, in sigmas: 2 residuals of a pose block (7) and a point (3).
class ReprojectionCost final : public ceres::SizedCostFunction<2, kPoseBlockSize, 3> {
 public:
  // `camera` must live as long as this.
  ReprojectionCost(const Camera& camera, const Eigen::Vector2d& ideal_px, double inverse_sigma_px)
      : camera_(&camera), ideal_px_(ideal_px), inverse_sigma_px_(inverse_sigma_px) {}

  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::Quaterniond> q(parameters[0]);
    const Eigen::Map<const Eigen::Vector3d> t(parameters[0] + 4), x_in_world(parameters[1]);
    const Eigen::Vector3d v = q.vec();
    const Eigen::Vector3d v_cross_x = v.cross(x_in_world);
    const Eigen::Vector3d x_in_cam = x_in_world + 2.0 * (q.w() * v_cross_x + v.cross(v_cross_x)) + t;

    const bool in_front = x_in_cam.z() > kMinProjectionDepth;
    const double inverse_z = 1.0 / std::max(x_in_cam.z(), kMinProjectionDepth);
    const double a = x_in_cam.x() * inverse_z;
    const double b = x_in_cam.y() * inverse_z;
    const double su = camera_->fx * inverse_sigma_px_;
    const double sv = camera_->fy * inverse_sigma_px_;
    residuals[0] = su * a + (camera_->cx - ideal_px_.x()) * inverse_sigma_px_;
    residuals[1] = sv * b + (camera_->cy - ideal_px_.y()) * inverse_sigma_px_;
    if (jacobians == nullptr) return true;

    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> J;                  // of x_in_cam
    J << su * inverse_z, 0.0, in_front ? -su * a * inverse_z : 0.0,  //
        0.0, sv * inverse_z, in_front ? -sv * b * inverse_z : 0.0;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 7, Eigen::RowMajor>> J_pose(jacobians[0]);
      // d (q x q*) / d vec(q), of the expression above; exact for unit q in every direction of the tangent.
      Eigen::Matrix3d d_vec = v * x_in_world.transpose() - 2.0 * x_in_world * v.transpose();
      d_vec.diagonal().array() += v.dot(x_in_world);
      d_vec = 2.0 * (d_vec - q.w() * Skew(x_in_world));
      J_pose.block<2, 3>(0, 0).noalias() = J * d_vec;
      J_pose.block<2, 1>(0, 3).noalias() = J * (2.0 * v_cross_x);
      J_pose.block<2, 3>(0, 4) = J;
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 2, 3, Eigen::RowMajor>> J_point(jacobians[1]);
      J_point.noalias() = J * q.toRotationMatrix();
    }
    return true;
  }

 private:
  const Camera* camera_;
  Eigen::Vector2d ideal_px_;
  double inverse_sigma_px_;
};

// Change of velocity over three poses, in sigmas: 3 residuals of three pose blocks.
class MotionCost final : public ceres::SizedCostFunction<3, kPoseBlockSize, kPoseBlockSize, kPoseBlockSize> {
 public:
  explicit MotionCost(const std::array<Eigen::Matrix3d, 3>& factors) : factors_(factors) {}  // MotionFactors

  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    Eigen::Map<Eigen::Vector3d> change(residuals);
    change.setZero();
    for (size_t k = 0; k < factors_.size(); ++k) {
      const Eigen::Map<const Eigen::Quaterniond> q(parameters[k]);
      const Eigen::Map<const Eigen::Vector3d> t(parameters[k] + 4);
      const Eigen::Matrix3d world_from_cam = q.toRotationMatrix().transpose();
      change -= factors_[k] * (world_from_cam * t);
      if (jacobians == nullptr || jacobians[k] == nullptr) continue;
      // Of the increment, then of the block.
      Eigen::Matrix<double, 3, 6> J_increment = Eigen::Matrix<double, 3, 6>::Zero();
      J_increment.rightCols<3>().noalias() = -factors_[k] * world_from_cam;
      Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus;
      PoseManifold().MinusJacobian(parameters[k], minus.data());
      Eigen::Map<Eigen::Matrix<double, 3, 7, Eigen::RowMajor>>(jacobians[k]).noalias() = J_increment * minus;
    }
    return true;
  }

 private:
  std::array<Eigen::Matrix3d, 3> factors_;
};

}  // namespace dynamic_slam
