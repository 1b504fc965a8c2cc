#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "dynamic_slam/features/downscaler.h"

namespace dynamic_slam {

// An image in smaller and smaller sizes. Keeps its memory between images.
class ImagePyramid {
 public:
  struct Level {
    cv::Mat image;                   // CV_8UC1
    float scale_x = 1, scale_y = 1;  // full-resolution px per px; the two differ as sizes are whole numbers

    // Pixel centres are at whole numbers, so the image's corner is at -0.5 at every level.
    float FullX(float x) const { return (x + 0.5f) * scale_x - 0.5f; }
    float FullY(float y) const { return (y + 0.5f) * scale_y - 0.5f; }
    Eigen::Vector2f ToFull(const Eigen::Vector2f& px) const { return {FullX(px.x()), FullY(px.y())}; }
    Eigen::Vector2f FromFull(const Eigen::Vector2f& px) const {
      return {(px.x() + 0.5f) / scale_x - 0.5f, (px.y() + 0.5f) / scale_y - 0.5f};
    }
  };

  // size: of the finest level, px. scale_factor: from each level to the next coarser one, above 1.
  ImagePyramid(cv::Size size, int levels, double scale_factor);

  // grey: CV_8UC1 of that size, whose pixels the finest level shares until ReleaseImage.
  void Build(const cv::Mat& grey);
  void ReleaseImage() { levels_.front().image = cv::Mat(); }

  size_t size() const { return levels_.size(); }
  const Level& operator[](size_t level) const { return levels_[level]; }
  cv::Size SizeOf(size_t level) const { return sizes_[level]; }

 private:
  std::vector<Level> levels_;
  std::vector<cv::Size> sizes_;
  std::vector<Downscaler> downscalers_;  // to each level but the finest
};

}  // namespace dynamic_slam
