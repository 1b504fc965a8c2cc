#include "dynamic_slam/sim/camera_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

constexpr double kRampS = 0.6;  // to stop, and to start again

double Heading(const World& world) {
  const Eigen::Vector3d ahead = world.camera_target - world.camera_centre;
  return std::atan2(ahead.y(), ahead.x());
}

double Wave(double time_s, double period_s, double phase = 0) {
  return std::sin(2 * std::numbers::pi * (time_s / period_s + phase));
}

// A camera that looks along yaw, then down by pitch, then rolled; angles in rad.
Rigid3 Looking(const Eigen::Vector3d& position, double yaw, double pitch_down, double roll) {
  Eigen::Matrix3d body_from_cam;  // body: x forward, y left, z up
  body_from_cam << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {ExpSo3({0, 0, yaw}) * ExpSo3({0, pitch_down, 0}) * ExpSo3({roll, 0, 0}) *
              Eigen::Quaterniond(body_from_cam),
          position};
}

}  // namespace

CameraMotion::CameraMotion(const CameraOptions& options, const World& world, uint64_t seed)
    : options_(options),
      centre_(world.camera_centre),
      target_(world.camera_target),
      heading_rad_(Heading(world)),
      hand_held_(seed, world.camera_centre, heading_rad_) {
  if (options.motion == "path") {
    if (world.camera_path.empty()) {
      throw InputError("camera.motion", "this world has no path",
                       "Use another motion: hand_held, xyz, rpy, halfsphere, static.");
    }
    path_ = world.camera_path.front();
  }
}

double CameraMotion::MovingTime(double time_s) const {
  if (options_.stop_s <= 0) return time_s;
  // The integral of a speed that goes from 1 to 0 and back along smooth steps, each of which takes half a
  // ramp away.
  const auto lost_since = [](double t) {  // of 1 - speed, after t of the ramp down
    const double x = std::clamp(t / kRampS, 0.0, 1.0);
    return kRampS * (x * x * x - 0.5 * x * x * x * x) + std::max(0.0, t - kRampS);
  };
  return time_s - (lost_since(time_s - options_.stop_at_s) -
                   lost_since(time_s - options_.stop_at_s - options_.stop_s));
}

Rigid3 CameraMotion::At(double time_s) const {
  const double t = MovingTime(time_s), a = options_.amplitude;
  const Eigen::Vector3d ahead(std::cos(heading_rad_), std::sin(heading_rad_), 0),
      left(-ahead.y(), ahead.x(), 0);
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d look = target_ - centre_;
  const double pitch = std::atan2(-look.z(), look.head<2>().norm());
  // A hand trembles a little.
  const Eigen::Vector3d tremor =
      0.002 * a * Eigen::Vector3d(Wave(t, 0.9), Wave(t, 0.7, 0.3), Wave(t, 1.1, 0.6));
  if (options_.motion == "path") return OnPath(t);
  if (options_.motion == "static") {
    return Looking(centre_ + 2 * tremor, heading_rad_ + tremor.x(), pitch + tremor.y(), tremor.z());
  }
  if (options_.motion == "xyz") {
    const Eigen::Vector3d offset =
        0.40 * Wave(t, 6.1) * left + 0.35 * Wave(t, 9.7) * ahead + 0.22 * Wave(t, 5.3, 0.1) * up;
    return Looking(centre_ + a * offset + tremor, heading_rad_ + 2 * tremor.x(), pitch + tremor.y(),
                   tremor.z());
  }
  if (options_.motion == "rpy") {
    const Eigen::Vector3d offset = 0.10 * (Wave(t, 4.3) * left + Wave(t, 6.9) * ahead + Wave(t, 5.1) * up);
    return Looking(centre_ + a * offset + tremor, heading_rad_ + a * 0.35 * Wave(t, 7.3),
                   pitch + a * 0.18 * Wave(t, 5.9), a * 0.22 * Wave(t, 4.7));
  }
  if (options_.motion == "halfsphere") {
    // About a point ahead on a half sphere of one metre, and always towards the target.
    const double around = 0.9 * a * Wave(t, 8.9), above = 0.35 + 0.45 * a * Wave(t, 6.1, 0.7);
    const Eigen::Vector3d direction = -std::cos(above) * std::cos(around) * ahead +
                                      std::cos(above) * std::sin(around) * left + std::sin(above) * up;
    const Eigen::Vector3d position =
        centre_ + 0.5 * ahead + 0.75 * direction - Eigen::Vector3d(0, 0, 0.25) + tremor;
    const Eigen::Vector3d to_target = target_ - position;
    return Looking(position, std::atan2(to_target.y(), to_target.x()),
                   std::atan2(-to_target.z(), to_target.head<2>().norm()), 0.03 * Wave(t, 3.7));
  }
  Rigid3 pose = hand_held_.At(t);
  pose.translation = centre_ + a * (pose.translation - centre_);
  return pose;
}

Rigid3 CameraMotion::OnPath(double time_s) const {
  const double distance = options_.speed_m_per_s * time_s, a = options_.amplitude;
  // The mean heading of what is passed and what comes next: one looks into a curve, and turns smoothly.
  constexpr int kHalf = 6;
  const double reach = std::clamp(0.9 * options_.speed_m_per_s, 0.8, 4.0);
  double heading = 0;
  for (int i = -kHalf; i <= kHalf; ++i) {
    heading +=
        path_->At(distance + reach * (0.3 + static_cast<double>(i) / kHalf)).heading_rad / (2 * kHalf + 1);
  }
  const PlanarPath::Place place = path_->At(distance);
  // Walking: a bob with each step; driving: slow waves of the road.
  const bool walks = options_.speed_m_per_s < 3;
  const double up =
      walks ? 0.018 * Wave(time_s, 0.56) : 0.015 * Wave(distance, 17) + 0.006 * Wave(distance, 5.3);
  const double sway = walks ? 0.02 * Wave(time_s, 1.12) : 0.08 * Wave(distance, 43);
  const Eigen::Vector2d left(-std::sin(place.heading_rad), std::cos(place.heading_rad));
  const Eigen::Vector2d at = place.position + a * sway * left;
  return Looking({at.x(), at.y(), options_.height_m + a * up}, heading + a * 0.02 * Wave(time_s, 3.1),
                 a * 0.012 * Wave(time_s, 2.3), a * 0.012 * Wave(time_s, 2.9));
}

}  // namespace dynamic_slam
