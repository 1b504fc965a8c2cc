#include "dynamic_slam/semantics/network_input.h"

#include <algorithm>
#include <cmath>

#include <opencv2/dnn.hpp>
#include <opencv2/imgproc.hpp>

namespace dynamic_slam {

NetworkInput MakeNetworkInput(const cv::Mat& image, const NetworkInputOptions& options) {
  cv::Mat colour = image;
  if (image.channels() == 1) cv::cvtColor(image, colour, cv::COLOR_GRAY2BGR);
  const cv::Size input_px(options.width, options.height);
  cv::Size used_px = input_px;
  if (options.resize == "letterbox") {
    const double scale = std::min(static_cast<double>(options.width) / image.cols,
                                  static_cast<double>(options.height) / image.rows);
    used_px.width = std::clamp(static_cast<int>(std::lround(image.cols * scale)), 1, options.width);
    used_px.height = std::clamp(static_cast<int>(std::lround(image.rows * scale)), 1, options.height);
  }
  cv::Mat resized(input_px, CV_8UC3, cv::Scalar::all(options.pad));
  cv::Mat used = resized(cv::Rect(cv::Point(), used_px));
  cv::resize(colour, used, used_px, 0, 0, cv::INTER_LINEAR);

  const bool is_rgb = options.channels == "rgb";
  cv::Scalar mean(options.mean_blue, options.mean_green, options.mean_red);
  if (is_rgb) std::swap(mean[0], mean[2]);  // it is taken off after the colours have been swapped
  NetworkInput input;
  cv::dnn::blobFromImage(resized, input.blob, options.scale, cv::Size(), mean, is_rgb);
  input.image_from_input = {static_cast<double>(image.cols) / used_px.width,
                            static_cast<double>(image.rows) / used_px.height};
  return input;
}

}  // namespace dynamic_slam
