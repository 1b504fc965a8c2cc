#include "dynamic_slam/calibration/board_coverage.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace dynamic_slam {

BoardCoverage::BoardCoverage(const std::vector<BoardView>& views, const cv::Size& image_size)
    : image_size_(image_size), counts_(kColumns * kRows) {
  for (const BoardView& view : views) {
    for (const cv::Point2f& corner : view.corners) {
      const int column = std::clamp(
          static_cast<int>(corner.x * kColumns / static_cast<float>(image_size.width)), 0, kColumns - 1);
      const int row = std::clamp(static_cast<int>(corner.y * kRows / static_cast<float>(image_size.height)),
                                 0, kRows - 1);
      ++counts_[static_cast<size_t>(row * kColumns + column)];
    }
  }
}

double BoardCoverage::Share() const {
  const auto seen = std::count_if(counts_.begin(), counts_.end(), [](int count) { return count > 0; });
  return static_cast<double>(seen) / static_cast<double>(counts_.size());
}

std::string BoardCoverage::Missing() const {
  std::vector<std::string> places;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      if (IsSeen(column, row)) continue;
      const std::string vertical = row == 0 ? "upper" : row == kRows - 1 ? "lower" : "";
      const std::string horizontal = column == 0 ? "left" : column == kColumns - 1 ? "right" : "";
      std::string place = "the middle";
      if (!vertical.empty() && !horizontal.empty()) {
        place = fmt::format("the {} {} corner", vertical, horizontal);
      } else if (!vertical.empty() || !horizontal.empty()) {
        place = fmt::format("the {}{} edge", vertical, horizontal);
      }
      if (std::find(places.begin(), places.end(), place) == places.end()) places.push_back(place);
    }
  }
  return fmt::format("{}", fmt::join(places, ", "));
}

cv::Rect BoardCoverage::Cell(int column, int row) const {
  const cv::Point first(column * image_size_.width / kColumns, row * image_size_.height / kRows);
  const cv::Point last((column + 1) * image_size_.width / kColumns, (row + 1) * image_size_.height / kRows);
  return {first, last};
}

cv::Mat BoardCoverage::Draw(const std::vector<BoardView>& views) const {
  const cv::Scalar kPaper(255, 255, 255), kMissing(170, 170, 255), kLine(200, 200, 200), kCorner(150, 80, 0);
  cv::Mat picture(image_size_, CV_8UC3, kPaper);
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      if (!IsSeen(column, row)) cv::rectangle(picture, Cell(column, row), kMissing, cv::FILLED);
      cv::rectangle(picture, Cell(column, row), kLine);
    }
  }
  const int radius = std::max(1, image_size_.width / 400);
  for (const BoardView& view : views) {
    for (const cv::Point2f& corner : view.corners)
      cv::circle(picture, corner, radius, kCorner, cv::FILLED, cv::LINE_AA);
  }
  return picture;
}

}  // namespace dynamic_slam
