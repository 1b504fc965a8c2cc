#pragma once

#include <memory>

#include "dynamic_slam/semantics/detector.h"

namespace dynamic_slam {

// OpenCV's detector of upright people (Dalal and Triggs, 2005), which needs no file. It finds whole people at
// least 100 px tall, and far fewer of them than a network.
std::unique_ptr<Detector> MakeHogDetector();

}  // namespace dynamic_slam
