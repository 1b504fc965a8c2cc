#pragma once

#include <optional>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// What a map says of the focal length that it was made with.
struct FocalGuess {
  double factor = 1;  // on that of the camera, with which the map fits its images best
  double gain = 0;    // by how much the errors are smaller then, as a share of their squares
};

// Adjusts poses, points and one factor on the focal lengths: bundle adjustment with self-calibration. Nothing
// when the map has too few keyframes. Where the camera only moved straight ahead, gain is small whatever the
// factor.
std::optional<FocalGuess> GuessFocalLength(const Camera& camera, const Map& map);

// The same of a map that is made of the images. Nothing without one. Throws InputError where a run would.
std::optional<FocalGuess> GuessFocalLength(const Camera& camera, FrameSource* source);

}  // namespace dynamic_slam
