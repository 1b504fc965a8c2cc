#pragma once

#include <optional>

#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// The path of what moves as odometry has it (REP 105): without jumps, while the pose in the map may jump
// where the map is corrected or the camera is found again.
class ContinuousPath {
 public:
  // The next pose. is_jump: the map was moved, or left and found again, since the last one; then the motion
  // between the two is not known, and the path goes on from where it is.
  void Add(const Rigid3& map_from_body, bool is_jump);

  // Of the last pose.
  const Rigid3& odom_from_body() const { return odom_from_body_; }
  Rigid3 map_from_odom() const { return map_from_body_ * odom_from_body_.Inverse(); }

  // What the last Add moved it by; none for the first and after a jump.
  const std::optional<Rigid3>& last_from_body() const { return last_from_body_; }

  // The next pose is the first one again; the path goes on.
  void Break() { is_first_ = true; }

 private:
  Rigid3 odom_from_body_, map_from_body_;
  std::optional<Rigid3> last_from_body_;
  bool is_first_ = true;
};

}  // namespace dynamic_slam
