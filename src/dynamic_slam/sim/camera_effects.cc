#include "dynamic_slam/sim/camera_effects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

// Gaussian noise: a table, as the logarithm and cosine of each pixel would take longer than the picture.
std::array<float, 4096> NoiseTable(Random& random, double sigma) {
  std::array<float, 4096> table;
  for (float& value : table) value = static_cast<float>(sigma * random.Gaussian());
  return table;
}

}  // namespace

cv::Mat DevelopImage(const EffectOptions& options, uint64_t seed, double time_s, const cv::Mat3f& light) {
  Random random(seed);
  const std::array<float, 4096> noise = NoiseTable(random, options.noise_grey);
  const double wave = std::sin(2 * std::numbers::pi * time_s / 7.3) * 0.7 +
                      std::sin(2 * std::numbers::pi * time_s / 2.9) * 0.3;
  const float gain = static_cast<float>(1 + options.exposure_change * wave);
  const float centre_x = 0.5f * static_cast<float>(light.cols - 1),
              centre_y = 0.5f * static_cast<float>(light.rows - 1);
  const float darker =
      static_cast<float>(options.vignette) / (centre_x * centre_x + centre_y * centre_y + 1.0f);
  cv::Mat image(light.size(), CV_8UC3);
  for (int row = 0; row < light.rows; ++row) {
    const float* from = light.ptr<float>(row);
    uint8_t* to = image.ptr<uint8_t>(row);
    const float dy = static_cast<float>(row) - centre_y;
    uint64_t bits = 0;
    for (int column = 0; column < light.cols; ++column, bits >>= 12, from += 3, to += 3) {
      if (column % 5 == 0) bits = random.Next();
      const float dx = static_cast<float>(column) - centre_x;
      const float factor = gain * (1.0f - darker * (dx * dx + dy * dy)), grain = noise[bits & 4095] + 0.5f;
      for (int k = 0; k < 3; ++k)
        to[k] = static_cast<uint8_t>(std::clamp(from[k] * factor + grain, 0.0f, 255.0f));
    }
  }
  return image;
}

}  // namespace dynamic_slam
