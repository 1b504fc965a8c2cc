#include "dynamic_slam/geometry/rolling_shutter.h"

#include <algorithm>

#include <Eigen/Geometry>

namespace dynamic_slam {

SteadyMotion MotionBetween(const Rigid3& later_from_earlier, double dt_s) {
  return {LogSo3(later_from_earlier.rotation) / dt_s, later_from_earlier.translation / dt_s};
}

SteadyMotion Mean(const SteadyMotion& a, const SteadyMotion& b) {
  return {0.5 * (a.angular_rad_s + b.angular_rad_s), 0.5 * (a.linear_per_s + b.linear_per_s)};
}

std::optional<SteadyMotion> MotionAt(const Trajectory& path, double timestamp_s) {
  constexpr double kMostBetween_s = 0.25;  // of the path before and after: the motion may change
  const auto at =
      std::lower_bound(path.begin(), path.end(), timestamp_s,
                       [](const StampedPose& pose, double stamp_s) { return pose.timestamp_s < stamp_s; });
  if (at == path.begin() || at == path.end() || at + 1 == path.end()) return std::nullopt;
  const StampedPose &before = *(at - 1), &after = *(at + 1);
  const double dt_s = after.timestamp_s - before.timestamp_s;
  if (at->timestamp_s != timestamp_s || !(dt_s > 0) || dt_s > kMostBetween_s) return std::nullopt;
  return MotionBetween(after.world_from_cam.Inverse() * before.world_from_cam, dt_s);
}

Eigen::Vector2d AtMiddleRow(const Camera& camera, const SteadyMotion& motion, const Eigen::Vector2d& ideal_px,
                            double raw_y, double inverse_depth) {
  const double since_s = (raw_y / (camera.height - 1) - 0.5) * camera.readout_s;
  const Eigen::Vector3d ray = camera.Unproject(ideal_px);
  const Eigen::Vector3d turn = motion.angular_rad_s.cross(ray);
  const Eigen::Vector3d then = ray - since_s * (turn + inverse_depth * motion.linear_per_s) +
                               0.5 * since_s * since_s * motion.angular_rad_s.cross(turn);
  return camera.Project(then);
}

}  // namespace dynamic_slam
