#include "dynamic_slam/eval/pose_list.h"

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

PoseList ToPoseList(const Trajectory& trajectory) {
  PoseList poses;
  poses.reserve(trajectory.size());
  for (const StampedPose& pose : trajectory) {
    poses.push_back({pose.timestamp_s, pose.world_from_cam.Matrix(), pose.world_from_cam.translation});
  }
  return poses;
}

double PathLength(const PoseList& poses) {
  double length_m = 0;
  for (size_t i = 1; i < poses.size(); ++i) length_m += (poses[i].position - poses[i - 1].position).norm();
  return length_m;
}

PoseList ToPoseList(std::span<const Eigen::Matrix<double, 3, 4>> world_from_cam,
                    std::span<const double> times_s) {
  if (!times_s.empty() && times_s.size() != world_from_cam.size()) {
    throw InputError("times", fmt::format("{} stamps for {} poses", times_s.size(), world_from_cam.size()),
                     "Give the times.txt of the same sequence.");
  }
  PoseList poses;
  poses.reserve(world_from_cam.size());
  for (size_t i = 0; i < world_from_cam.size(); ++i) {
    const double timestamp_s = times_s.empty() ? static_cast<double>(i) : times_s[i];
    poses.push_back({timestamp_s, world_from_cam[i].leftCols<3>(), world_from_cam[i].col(3)});
  }
  return poses;
}

}  // namespace dynamic_slam
