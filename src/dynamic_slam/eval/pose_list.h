#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

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

PoseList ToPoseList(const Trajectory& trajectory);

// Reads lines of "timestamp tx ty tz qx qy qz qw"; '#' starts a comment.
// Throws InputError with file and line for what is not that, for zero quaternions, stamps that decrease, and
// files without a pose.
PoseList ReadTumPoses(const std::string& path);

// Reads lines of 12 numbers, the upper 3x4 part of world_from_cam row by row. The stamps are the row numbers,
// or, when times_path is not empty, the numbers of that file (one a line, as many as poses). Throws
// InputError as above.
PoseList ReadKittiPoses(const std::string& path, const std::string& times_path);

}  // namespace dynamic_slam
