#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/export.h"
#include "dynamic_slam/geometry/trajectory.h"

namespace dynamic_slam {

// All readers throw InputError with file:line, the reason and the remedy. All writers write FILE.tmp and
// rename it.

// TUM format: "timestamp tx ty tz qx qy qz qw" (s, m, unit quaternion), comments with #. The quaternion's
// norm may differ from 1 by 0.01, as rounded files do, and is corrected. Stamps must not go back.
DYNAMIC_SLAM_API Trajectory ReadTumTrajectory(const std::filesystem::path& file);
DYNAMIC_SLAM_API void WriteTumTrajectory(const std::filesystem::path& file,
                                         std::span<const StampedPose> trajectory);

// Three rows of a transform world_from_cam as the file has them, so that an evaluator sees the same numbers
// as others: the rotation of a rounded file is orthonormal to some 1e-6 only.
using KittiMatrix = Eigen::Matrix<double, 3, 4>;

// KITTI odometry format: 12 numbers a line, row by row.
std::vector<KittiMatrix> ReadKittiMatrices(const std::filesystem::path& file);
// The same as rigid transforms world_from_cam.
std::vector<Rigid3> ReadKittiPoses(const std::filesystem::path& file);
void WriteKittiPoses(const std::filesystem::path& file, std::span<const Rigid3> world_from_cam);

// KITTI's times.txt: one stamp a line, s. Stamps must not go back.
std::vector<double> ReadTimes(const std::filesystem::path& file);

// Ground truth that a data set keeps with the images: groundtruth.txt (TUM format) in the folder, or, for a
// KITTI sequence folder sequences/NN, poses/NN.txt beside `sequences` with the stamps of times.txt. Nothing
// when there is none.
std::optional<Trajectory> LoadGroundTruth(const std::filesystem::path& source);

// Ground truth in any file: TUM format, or KITTI's with the stamps of times.txt in the source's folder.
// Throws InputError.
DYNAMIC_SLAM_API Trajectory ReadGroundTruth(const std::filesystem::path& file,
                                            const std::filesystem::path& source);

}  // namespace dynamic_slam
