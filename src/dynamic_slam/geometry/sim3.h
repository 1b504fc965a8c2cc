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

}  // namespace dynamic_slam
