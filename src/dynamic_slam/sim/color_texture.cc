#include "dynamic_slam/sim/color_texture.h"

#include <algorithm>
#include <bit>

#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

ColorTexture::ColorTexture(const cv::Mat& bgr) {
  DS_CHECK(bgr.type() == CV_8UC3 && !bgr.empty());
  const auto power = [](int side) { return static_cast<int>(std::bit_ceil(static_cast<unsigned>(side))); };
  cv::Mat image;
  cv::resize(bgr, image, {power(bgr.cols), power(bgr.rows)}, 0, 0, cv::INTER_LINEAR);
  cv::cvtColor(image, image, cv::COLOR_BGR2BGRA);
  while (true) {
    levels_.push_back({image.cols, image.rows, {image.data, image.data + image.total() * 4}});
    if (image.total() == 1) break;
    cv::Mat half;
    cv::resize(image, half, {std::max(image.cols / 2, 1), std::max(image.rows / 2, 1)}, 0, 0, cv::INTER_AREA);
    image = half;
  }
}

cv::v_float32x4 ColorTexture::SampleLevel(const Level& level, float u, float v) {
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

cv::v_float32x4 ColorTexture::Sample(float u, float v, float level) const {
  level = std::clamp(level, 0.0f, static_cast<float>(levels_.size() - 1));
  const int fine = static_cast<int>(level);
  const float share = level - static_cast<float>(fine);
  const cv::v_float32x4 value = SampleLevel(levels_[fine], u, v);
  if (share < 0.03f) return value;
  return value + cv::v_setall_f32(share) * (SampleLevel(levels_[fine + 1], u, v) - value);
}

}  // namespace dynamic_slam
