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

std::map<double, SteadyMotion> MotionsAlong(const Trajectory& path) {
  constexpr double kSteady_s = 0.125;  // later the motion may be another
  const auto follows = [&](size_t i) { return path[i].timestamp_s - path[i - 1].timestamp_s <= kSteady_s; };
  std::map<double, SteadyMotion> motions;
  for (size_t i = 0; i < path.size(); ++i) {
    const StampedPose& before = path[i > 0 && follows(i) ? i - 1 : i];
    const StampedPose& after = path[i + 1 < path.size() && follows(i + 1) ? i + 1 : i];
    if (!(before.timestamp_s < after.timestamp_s)) continue;
    motions[path[i].timestamp_s] = MotionBetween(after.world_from_cam.Inverse() * before.world_from_cam,
                                                 after.timestamp_s - before.timestamp_s);
  }
  return motions;
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
