#pragma once

#include <optional>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// What a map says of the camera that it was made with: bundle adjustment with one of the camera's numbers
// free.
struct SelfCalibration {
  // Of the focal lengths, with which the map fits its images best.
  double focal_factor = 1;
  // By how much the errors are smaller then, as a share of their squares.
  double focal_gain = 0;

  // The camera's readout_s with which it fits them best. Without the frames about keyframes: the camera's
  // own.
  double readout_s = 0;
  double readout_gain = 0;
};

// frames: of the first part of the map, stamps rising. Nothing when the map has too few keyframes. Where the
// camera only moved straight ahead, focal_gain is small whatever the factor; where it hardly moved,
// readout_gain is.
std::optional<SelfCalibration> CalibrateByMap(const Camera& camera, const Map& map, const Trajectory& frames);

// The same of a map that is made of the images. Nothing without one. Throws InputError where a run would.
std::optional<SelfCalibration> CalibrateByMap(const Camera& camera, FrameSource* source);

}  // namespace dynamic_slam
