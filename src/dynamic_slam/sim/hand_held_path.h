#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// A camera in a hand that looks around from about one place: sums of sines in position and angle, so every
// derivative is smooth and known.
//
// It sways about `centre` in the world (z up), looks along `heading_rad` (about z, 0 is along x), and moves
// some 0.5 m/s: sideways 0.6 to 0.8 m, forward 0.3 to 0.45 m, up 0.15 to 0.25 m; yaw to 30, pitch to 9, roll
// to 3 degrees.
class HandHeldPath {
 public:
  HandHeldPath(uint64_t seed, const Eigen::Vector3d& centre, double heading_rad);

  // world_from_cam at a time (s). Camera axes: x right, y down, z forward.
  Rigid3 At(double time_s) const;

  // Never farther than this from the centre, m.
  static constexpr double kReach = 1.0;

 private:
  struct Sine {
    double amplitude, rate, phase;  // rate in rad/s
  };
  using Wave = std::vector<Sine>;
  static double Value(const Wave& wave, double time_s);

  Eigen::Vector3d centre_;
  double heading_rad_;
  Wave right_, forward_, up_;  // m
  Wave yaw_, pitch_, roll_;    // rad
};

}  // namespace dynamic_slam
