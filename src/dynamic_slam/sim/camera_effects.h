#pragma once

#include <cstdint>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/sim/scene_options.h"

namespace dynamic_slam {

// What a camera makes of the light of a frame at a time (s): brightness that comes and goes, darker corners,
// noise, eight bits. `light`: blue, green, red, 0 to 255.
cv::Mat DevelopImage(const EffectOptions& options, uint64_t seed, double time_s, const cv::Mat3f& light);

}  // namespace dynamic_slam
