#pragma once

#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/semantics/point_motion.h"

namespace dynamic_slam {

// Follows corners from one image to the next, on whatever moves: what a BoxCompensation wants to know where
// no SLAM runs beside it. OpenCV's pyramidal Lucas-Kanade on images of half the size; the same images give
// the same motions.
class ImageMotion {
 public:
  // The motions from the last image to this one, CV_8UC1 or CV_8UC3 (BGR), px of the image; none for the
  // first one and for one of another size.
  std::vector<PointMotion> Update(const cv::Mat& image);

 private:
  cv::Mat last_;  // grey and small
  cv::Size last_size_;
};

}  // namespace dynamic_slam
