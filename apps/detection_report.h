#pragma once

#include <span>
#include <string>

#include "dynamic_slam/io/box_file.h"

namespace dynamic_slam {

// Prints how the boxes of persons compare to the true ones: recall, precision and miss rate (Eq. 1-2), per
// box and per frame (section 4.1), a row for what the detector saw and, unless `compensation` is "none", one
// for `compensated`. Truth at other times than `stamps_s` (seconds, in order) is not looked at.
void PrintDetectionReport(std::span<const BoxRecord> truth, std::span<const double> stamps_s,
                          std::span<const BoxRecord> detected, const std::string& compensation,
                          std::span<const BoxRecord> compensated);

}  // namespace dynamic_slam
