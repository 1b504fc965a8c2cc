#pragma once

#include <span>
#include <vector>

#include "dynamic_slam/geometry/trajectory.h"

namespace dynamic_slam {

// The most probable path, given poses that were found each for itself: these are noisy, and what carries a
// camera has mass. Position and orientation are smoothed apart, each under white noise of acceleration
// (Bar-Shalom, Li, Kirubarajan 2001, 6.2.2), by the smoother of Rauch, Tung and Striebel (1965). How much of
// what is seen is noise and how much is motion is what makes the poses most probable, so that exact ones
// stay, and nothing is to be set: neither for a hand, a car or a drone, nor for a unit of length. Both may
// have outliers: they are Student's, by reweighting. Nothing is smoothed over a cut of the film. Poses in the
// order of time; fewer than 10 stay as they are.
std::vector<Rigid3> SmoothPath(std::span<const StampedPose> poses);

// The parts of the path between cuts of the film, in their order.
std::vector<std::span<const StampedPose>> ShotsOf(std::span<const StampedPose> poses);

// The spectral density of the acceleration's noise of such a path, m^2/s^3 in each coordinate (m: the path's
// unit of length); 0 where that is not known: with fewer than 20 poses, or where they stand exactly. Over a
// time t a velocity changes by its root times that of t.
double AccelerationNoise(std::span<const StampedPose> poses);

// The variance of the noise of the positions, m^2 in each coordinate; 0 where it is not known, or too small
// to show beside the motion.
double PositionVariance(std::span<const StampedPose> poses);

}  // namespace dynamic_slam
