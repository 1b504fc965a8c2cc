#pragma once

#include <algorithm>
#include <vector>

#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

// A colour image with its half, quarter, ... sizes, so that it can be sampled at any distance without
// aliasing. It repeats without end in both directions.
class ColorTexture {
 public:
  // `bgr`: CV_8UC3; resized to the next powers of two.
  explicit ColorTexture(const cv::Mat& bgr);

  int width() const { return levels_.front().width; }  // texels
  int height() const { return levels_.front().height; }

  // Blue, green, red and 0 at (u, v), where the image is [0, 1) x [0, 1), v down. `level` 0 is the whole
  // image; linear between texels and between levels.
  cv::v_float32x4 Sample(float u, float v, float level) const;

  // Blue alone, of one of the levels: for grey pictures.
  float SampleFirst(float u, float v, int level) const;

 private:
  struct Level {
    int width, height;  // powers of two
    std::vector<uint8_t> texels;
  };
  static cv::v_float32x4 SampleLevel(const Level& level, float u, float v);

  std::vector<Level> levels_;
};

inline cv::v_float32x4 ColorTexture::SampleLevel(const Level& level, float u, float v) {
  const float x = u * static_cast<float>(level.width) - 0.5f, y = v * static_cast<float>(level.height) - 0.5f;
  const int left = static_cast<int>(x) - (x < 0), top = static_cast<int>(y) - (y < 0);
  const int x0 = left & (level.width - 1), x1 = (left + 1) & (level.width - 1);
  const int y0 = top & (level.height - 1), y1 = (top + 1) & (level.height - 1);
  const uint8_t* upper = level.texels.data() + 4 * static_cast<size_t>(y0) * level.width;
  const uint8_t* lower = level.texels.data() + 4 * static_cast<size_t>(y1) * level.width;
  const auto texel = [](const uint8_t* row, int column) {
    return cv::v_cvt_f32(cv::v_reinterpret_as_s32(cv::v_load_expand_q(row + 4 * column)));
  };
  const cv::v_float32x4 right_share = cv::v_setall_f32(x - static_cast<float>(left));
  const cv::v_float32x4 lower_share = cv::v_setall_f32(y - static_cast<float>(top));
  const cv::v_float32x4 a = texel(upper, x0), b = texel(lower, x0);
  const cv::v_float32x4 above = a + right_share * (texel(upper, x1) - a);
  const cv::v_float32x4 below = b + right_share * (texel(lower, x1) - b);
  return above + lower_share * (below - above);
}

inline cv::v_float32x4 ColorTexture::Sample(float u, float v, float level) const {
  level = std::clamp(level, 0.0f, static_cast<float>(levels_.size() - 1));
  const int fine = static_cast<int>(level);
  // Half of the way one level is enough: it looks the same, and takes less time.
  const float share = std::clamp(2.0f * (level - static_cast<float>(fine)) - 0.5f, 0.0f, 1.0f);
  if (share == 1.0f) return SampleLevel(levels_[fine + 1], u, v);
  const cv::v_float32x4 value = SampleLevel(levels_[fine], u, v);
  if (share == 0.0f) return value;
  return value + cv::v_setall_f32(share) * (SampleLevel(levels_[fine + 1], u, v) - value);
}

inline float ColorTexture::SampleFirst(float u, float v, int index) const {
  const Level& level = levels_[std::min(index, static_cast<int>(levels_.size()) - 1)];
  const float x = u * static_cast<float>(level.width) - 0.5f, y = v * static_cast<float>(level.height) - 0.5f;
  const int left = static_cast<int>(x) - (x < 0), top = static_cast<int>(y) - (y < 0);
  const int x0 = 4 * (left & (level.width - 1)), x1 = 4 * ((left + 1) & (level.width - 1));
  const uint8_t* upper = level.texels.data() + 4 * (top & (level.height - 1)) * level.width;
  const uint8_t* lower = level.texels.data() + 4 * ((top + 1) & (level.height - 1)) * level.width;
  const float right_share = x - static_cast<float>(left), lower_share = y - static_cast<float>(top);
  const float above = upper[x0] + right_share * static_cast<float>(upper[x1] - upper[x0]);
  const float below = lower[x0] + right_share * static_cast<float>(lower[x1] - lower[x0]);
  return above + lower_share * (below - above);
}

}  // namespace dynamic_slam
