#pragma once

#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// A similarity: x_in_target = scale * (rotation * x_in_source) + translation.
struct Sim3 {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_source) const {
    return scale * (rotation * x_in_source) + translation;
  }
  Sim3 operator*(const Sim3& source_from_other) const {
    return {scale * source_from_other.scale, (rotation * source_from_other.rotation).normalized(),
            scale * (rotation * source_from_other.translation) + translation};
  }
  Sim3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {1.0 / scale, inverse, -(inverse * translation) / scale};
  }
};

inline Sim3 ToSim3(const Rigid3& target_from_source) {
  return {1.0, target_from_source.rotation, target_from_source.translation};
}

// The rigid transform that shows the same in a camera: of a source that has its unit of length, to a target
// that has the source's too.
inline Rigid3 ToRigid3(const Sim3& target_from_source) {
  return {target_from_source.rotation, target_from_source.translation / target_from_source.scale};
}

}  // namespace dynamic_slam
