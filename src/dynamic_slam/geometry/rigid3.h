#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "dynamic_slam/base/export.h"

namespace dynamic_slam {

inline Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// Rotation vector (rad) to unit quaternion.
DYNAMIC_SLAM_API Eigen::Quaterniond ExpSo3(const Eigen::Vector3d& rotation_vector);

// Unit quaternion to rotation vector (rad) of length at most pi.
DYNAMIC_SLAM_API Eigen::Vector3d LogSo3(const Eigen::Quaterniond& rotation);

// A rigid transform: x_in_target = rotation * x_in_source + translation. Name it target_from_source.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3() = default;
  Rigid3(const Eigen::Quaterniond& rotation_in, const Eigen::Vector3d& translation_in)
      : rotation(rotation_in.normalized()), translation(translation_in) {}
  Rigid3(const Eigen::Matrix3d& rotation_in, const Eigen::Vector3d& translation_in)
      : Rigid3(Eigen::Quaterniond(rotation_in), translation_in) {}

  Eigen::Matrix3d Matrix() const { return rotation.toRotationMatrix(); }
  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_source) const {
    return rotation * x_in_source + translation;
  }
  Rigid3 operator*(const Rigid3& source_from_other) const {
    return {rotation * source_from_other.rotation, rotation * source_from_other.translation + translation};
  }
  Rigid3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {inverse, -(inverse * translation)};
  }
  // The source frame's origin as seen in the target frame is `translation`; this is the converse: the
  // target frame's origin in the source frame (a camera's centre, for cam_from_world).
  Eigen::Vector3d TargetOriginInSource() const { return -(rotation.conjugate() * translation); }

  bool operator==(const Rigid3& other) const {
    return rotation.coeffs() == other.rotation.coeffs() && translation == other.translation;
  }

  bool IsFinite() const { return rotation.coeffs().allFinite() && translation.allFinite(); }
};

// Angle between two rotations, rad, in [0, pi].
DYNAMIC_SLAM_API double RotationAngle(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

}  // namespace dynamic_slam
