#pragma once

#include <optional>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/mapping/map_calibration.h"

namespace dynamic_slam {

// CalibrateByMap of a map that is made of the images. Nothing without one. Throws InputError where a run
// would.
std::optional<SelfCalibration> CalibrateByMap(const Camera& camera, FrameSource* source);

}  // namespace dynamic_slam
