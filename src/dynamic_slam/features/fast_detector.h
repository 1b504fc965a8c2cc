#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

struct Corner {
  uint16_t x, y;  // px
  float dx, dy;   // from there to the peak of the score between the pixels; in [-0.5, 0.5] px
  uint8_t score;  // grey levels, see FastDetector
};

// FAST-9 corners (Rosten and Drummond 2006) with 3x3 non-maximum suppression. The score of a pixel is the
// largest contrast d such that 9 neighbouring pixels of the 16 on the circle of radius 3 are all brighter, or
// all darker, than the centre by at least d. It is computed for every pixel without branches, 32 pixels at a
// time: on textured images that beats the usual decision tree, and gives the corners of every higher
// threshold too.
class FastDetector {
 public:
  // Appends the corners with score > threshold, row by row, at least `border` (>= 4) px from the edges of the
  // image (CV_8UC1). Of neighbours with the same score the first counts.
  void Detect(const cv::Mat& image, int border, int threshold, std::vector<Corner>* corners);

 private:
  std::vector<uint8_t> rows_;  // scores of three rows in turn, and the marks of the maxima
};

}  // namespace dynamic_slam
