#pragma once

#include <bit>
#include <cstdint>

namespace dynamic_slam {

// log2 to 0.01, for x >= 1: the exponent and a parabola through the mantissa.
inline float FastLog2(float x) {
  const uint32_t bits = std::bit_cast<uint32_t>(x);
  const float mantissa = std::bit_cast<float>((bits & 0x007fffffu) | 0x3f800000u);
  return static_cast<float>(static_cast<int>(bits >> 23) - 128) + mantissa * (2.0f - mantissa / 3.0f) -
         2.0f / 3.0f;
}

}  // namespace dynamic_slam
