#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/export.h"
#include "dynamic_slam/geometry/trajectory.h"

namespace dynamic_slam {

// A pose as its file states it. Rotations of KITTI files are rounded to a few digits; they stay as they are,
// as in evo, because making them orthonormal moves results in the seventh digit.
struct EvalPose {
  double timestamp_s = 0;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // world_from_cam
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      // m, the camera in the world
};

using PoseList = std::vector<EvalPose>;

DYNAMIC_SLAM_API PoseList ToPoseList(const Trajectory& trajectory);

// m, from position to position.
DYNAMIC_SLAM_API double PathLength(const PoseList& poses);

// From the upper 3x4 parts of world_from_cam, as KITTI's files have them. `times_s` holds a stamp for each;
// when it is empty, the stamps are the row numbers. Throws InputError when there are more or fewer stamps
// than poses.
DYNAMIC_SLAM_API PoseList ToPoseList(std::span<const Eigen::Matrix<double, 3, 4>> world_from_cam,
                                     std::span<const double> times_s);

}  // namespace dynamic_slam
