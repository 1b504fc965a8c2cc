#pragma once

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/calibration/board_views.h"

namespace dynamic_slam {

// Where in the image the board's corners were seen: where none were, a lens is not known.
class BoardCoverage {
 public:
  static constexpr int kColumns = 6, kRows = 4;  // of cells

  BoardCoverage(const std::vector<BoardView>& views, const cv::Size& image_size);

  // Share of the cells with corners.
  double Share() const;

  // Where the board should be held next, in words, "the upper left corner, the right edge"; "" when nothing
  // is missing.
  std::string Missing() const;

  // The image's area with all corners as dots and the cells without any in red, CV_8UC3.
  cv::Mat Draw(const std::vector<BoardView>& views) const;

 private:
  bool IsSeen(int column, int row) const { return counts_[static_cast<size_t>(row * kColumns + column)] > 0; }
  cv::Rect Cell(int column, int row) const;

  cv::Size image_size_;
  std::vector<int> counts_;  // corners in each cell, row by row
};

}  // namespace dynamic_slam
