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

}  // namespace dynamic_slam
