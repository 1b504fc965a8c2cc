#include "dynamic_slam/sim/hand_held_path.h"

#include <cmath>
#include <numbers>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {

HandHeldPath::HandHeldPath(uint64_t seed, const Eigen::Vector3d& centre, double heading_rad)
    : centre_(centre), heading_rad_(heading_rad) {
  Random random(seed);
  const auto wave = [&random](double low, double high, double period_low_s, double period_high_s,
                              double shake) {
    const auto sine = [&random](double amplitude, double period_s) {
      return Sine{amplitude, 2.0 * std::numbers::pi / period_s, random.Uniform(0, 2.0 * std::numbers::pi)};
    };
    const double amplitude = random.Uniform(low, high),
                 period_s = random.Uniform(period_low_s, period_high_s);
    // The slow sway, a faster one on top, and the hand's shake.
    return Wave{sine(amplitude, period_s), sine(0.08 * amplitude, period_s * random.Uniform(0.25, 0.4)),
                sine(shake, random.Uniform(0.6, 1.2))};
  };
  right_ = wave(0.60, 0.80, 7, 9, 0.003);
  forward_ = wave(0.30, 0.45, 5, 7, 0.002);
  up_ = wave(0.15, 0.25, 4, 6, 0.003);
  yaw_ = wave(0.35, 0.50, 8, 11, 0.004);
  pitch_ = wave(0.10, 0.15, 5, 7, 0.004);
  roll_ = wave(0.03, 0.05, 4, 6, 0.003);
}

double HandHeldPath::Value(const Wave& wave, double time_s) {
  double sum = 0;
  for (const Sine& sine : wave) sum += sine.amplitude * std::sin(sine.rate * time_s + sine.phase);
  return sum;
}

Rigid3 HandHeldPath::At(double time_s) const {
  const Eigen::AngleAxisd heading(heading_rad_, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d sway(Value(forward_, time_s), -Value(right_, time_s), Value(up_, time_s));
  Eigen::Matrix3d body_from_cam;  // body: x forward, y left, z up
  body_from_cam << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const Eigen::Quaterniond turn = Eigen::AngleAxisd(Value(yaw_, time_s), Eigen::Vector3d::UnitZ()) *
                                  Eigen::AngleAxisd(Value(pitch_, time_s), Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(Value(roll_, time_s), Eigen::Vector3d::UnitX());
  return {heading * turn * Eigen::Quaterniond(body_from_cam), centre_ + heading * sway};
}

}  // namespace dynamic_slam
