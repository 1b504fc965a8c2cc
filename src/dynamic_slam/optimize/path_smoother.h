#pragma once

#include <span>
#include <vector>

#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

struct PathPose {
  double timestamp_s = 0;
  Rigid3 world_from_cam;  // any unit of length
};

// The most probable path, given poses that were found each for itself: these are noisy, and what carries a
// camera has mass. Position and orientation are smoothed apart, each under white noise of acceleration
// (Bar-Shalom, Li, Kirubarajan 2001, 6.2.2), by the smoother of Rauch, Tung and Striebel (1965). How much of
// what is seen is noise and how much is motion is what makes the poses most probable, so that exact ones
// stay, and nothing is to be set: neither for a hand, a car or a drone, nor for a unit of length. Both may
// have outliers: they are Student's, by reweighting. Poses in the order of time; fewer than 10 stay as they
// are.
std::vector<Rigid3> SmoothPath(std::span<const PathPose> poses);

}  // namespace dynamic_slam
