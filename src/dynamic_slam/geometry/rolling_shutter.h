#pragma once

#include <map>

#include <Eigen/Core>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/geometry/trajectory.h"

namespace dynamic_slam {

// How a camera moves, seen from itself: what is at rest at x_in_cam goes with angular_rad_s x x_in_cam +
// linear_per_s.
struct SteadyMotion {
  Eigen::Vector3d angular_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d linear_per_s = Eigen::Vector3d::Zero();  // in the unit of the poses
};

// The steady motion from one pose to another, dt_s later, or earlier where that is negative; not 0.
SteadyMotion MotionBetween(const Rigid3& later_from_earlier, double dt_s);

// The mean of two: at the pose between them.
SteadyMotion Mean(const SteadyMotion& a, const SteadyMotion& b);

// How the camera moved about the poses of its path, by their stamps: from the frame before to the one after,
// or to one of them where the other is missing. Of poses that lack both nobody knows.
std::map<double, SteadyMotion> MotionsAlong(const Trajectory& path);

// A rolling shutter reads the rows of an image one after the other, for Camera::readout_s in all, and a pose
// is that of the camera when it reads the middle one. Returns where (ideal px) the camera would have seen
// then what it saw at ideal_px in the raw row raw_y. inverse_depth: of what it shows, along the optical axis;
// 0: far away. To second order in the rotation since: within 0.1 px at 2 rad/s and 1 m/s about each axis,
// 0.5 m from what is seen, with 23 ms (rolling_shutter_test).
Eigen::Vector2d AtMiddleRow(const Camera& camera, const SteadyMotion& motion, const Eigen::Vector2d& ideal_px,
                            double raw_y, double inverse_depth);

}  // namespace dynamic_slam
