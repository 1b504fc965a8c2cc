#pragma once

#include <optional>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// By so much smaller errors, as a share of their squares, a lens is otherwise than the camera says: KITTI has
// 0.020, fr1_desk 0.003, with people 0.006, rendered scenes less than 0.001.
inline constexpr double kNotableLensGain = 0.015;

// What a map says of the camera that it was made with: bundle adjustment with one of the camera's numbers, or
// two of its lens, free.
struct SelfCalibration {
  // Of the focal lengths, with which the map fits its images best.
  double focal_factor = 1;
  // By how much the errors are smaller then, as a share of their squares.
  double focal_gain = 0;

  // The camera's readout_s with which it fits them best. Without the frames about keyframes: the camera's
  // own.
  double readout_s = 0;
  double readout_gain = 0;

  // The camera's k1 and k2 with which it fits them best, exact where its lens has no other coefficients. Of
  // another model: its own.
  double k1 = 0, k2 = 0;
  double lens_gain = 0;
};

// frames: of the first part of the map, stamps rising. Nothing when the map has too few keyframes. Where the
// camera only moved straight ahead, focal_gain is small whatever the factor; where it hardly moved,
// readout_gain is. Where a lens is known only as the map is bent by it, the answer is to be asked for again
// with it.
std::optional<SelfCalibration> CalibrateByMap(const Camera& camera, const Map& map, const Trajectory& frames);

// Only the lens, of fewer keyframes, and all else the camera's own. Nothing either of another model, or of a
// map that sees little.
std::optional<SelfCalibration> CalibrateLensByMap(const Camera& camera, const Map& map);

}  // namespace dynamic_slam
