#pragma once

#include <cstdint>
#include <optional>

#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/sim/hand_held_path.h"
#include "dynamic_slam/sim/world.h"

namespace dynamic_slam {

// Where the camera is at any time: one of the motions of TUM's sequences about the world's place for a
// camera, or along the world's path, with an optional stop. Smooth everywhere.
class CameraMotion {
 public:
  // Throws InputError when the motion is `path` and the world has none.
  CameraMotion(const CameraOptions& options, const World& world, uint64_t seed);

  // world_from_cam at a time (s). Camera axes: x right, y down, z forward.
  Rigid3 At(double time_s) const;

  // The time as the camera feels it: it stands still during the stop.
  double MovingTime(double time_s) const;

 private:
  Rigid3 OnPath(double time_s) const;

  CameraOptions options_;
  Eigen::Vector3d centre_, target_;
  double heading_rad_;
  HandHeldPath hand_held_;
  std::optional<PlanarPath> path_;
};

}  // namespace dynamic_slam
