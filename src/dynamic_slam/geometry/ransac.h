#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {

// kSize different indices below n, n >= kSize.
template <int kSize>
std::array<uint32_t, kSize> DrawSample(uint32_t n, Random& random) {
  std::array<uint32_t, kSize> sample;
  for (int i = 0; i < kSize; ++i) {
    do {
      sample[i] = random.Index(n);
    } while (std::find(sample.begin(), sample.begin() + i, sample[i]) != sample.begin() + i);
  }
  return sample;
}

// Samples to draw so that one is free of outliers with probability `confidence`; at most `limit`.
inline int RansacIterations(double inlier_ratio, int sample_size, double confidence, int limit) {
  const double good = std::pow(inlier_ratio, sample_size);
  if (good >= 1) return 1;
  const double needed = std::log(1 - confidence) / std::log1p(-good);  // infinite when nothing fits
  return needed < limit ? std::max(1, static_cast<int>(std::ceil(needed))) : limit;
}

}  // namespace dynamic_slam
