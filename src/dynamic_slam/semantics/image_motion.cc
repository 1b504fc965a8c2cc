#include "dynamic_slam/semantics/image_motion.h"

#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace dynamic_slam {
namespace {

constexpr int kMostPoints = 600;
constexpr double kQuality = 0.005;  // of a corner, of the best one's: people wear plain clothes
constexpr double kSpacing = 4;      // px of the small image
constexpr int kWindow = 11;         // px
constexpr int kLevels = 3;          // of the pyramid above it
constexpr int kLargeWidth = 480;    // px; a wider image is halved

}  // namespace

std::vector<PointMotion> ImageMotion::Update(const cv::Mat& image) {
  cv::Mat grey = image, small;
  if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  const double scale = image.cols > kLargeWidth ? 2 : 1;
  cv::resize(grey, small, {}, 1 / scale, 1 / scale, cv::INTER_AREA);
  std::vector<PointMotion> motions;
  std::vector<cv::Point2f> from, to;
  if (last_size_ == image.size()) {
    cv::goodFeaturesToTrack(last_, from, kMostPoints, kQuality, kSpacing);
  }
  if (!from.empty()) {
    std::vector<uchar> is_found;
    std::vector<float> errors;
    cv::calcOpticalFlowPyrLK(last_, small, from, to, is_found, errors, {kWindow, kWindow}, kLevels);
    // The centre of a small pixel lies between those of the pixels that it stands for.
    const auto to_image = [&](const cv::Point2f& p) {
      return Eigen::Vector2d((p.x + 0.5) * scale - 0.5, (p.y + 0.5) * scale - 0.5);
    };
    for (size_t i = 0; i < from.size(); ++i) {
      if (is_found[i] != 0) motions.push_back({to_image(from[i]), to_image(to[i])});
    }
  }
  last_ = small;
  last_size_ = image.size();
  return motions;
}

}  // namespace dynamic_slam
