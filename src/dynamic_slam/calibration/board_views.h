#pragma once

#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

// A chessboard. Its inner corners are where four squares meet: one less than the squares, each way.
struct Board {
  int columns = 9, rows = 6;  // of inner corners
  double square_m = 0.025;    // edge of a square
};

// The board in one image: its inner corners, row by row, px.
struct BoardView {
  std::string name;  // of the image
  std::vector<cv::Point2f> corners;
};

// "9x6". Throws InputError.
Board ParseBoard(const std::string& text, double square_m);

// The board in an image (CV_8UC1), all of it, or nothing. After Duda and Frese, "Accurate detection and
// localization of checkerboard corners for calibration" (2018), as OpenCV has it, refined by gradients.
std::optional<BoardView> FindBoard(const cv::Mat& grey, const Board& board, const std::string& name);

// Views that differ from each other: of a film in which the board rests, one is enough.
class BoardViews {
 public:
  explicit BoardViews(const cv::Size& image_size) : image_size_(image_size) {}

  // Whether the view shows something new, and was kept.
  bool Add(BoardView view);

  const std::vector<BoardView>& views() const { return views_; }
  const cv::Size& image_size() const { return image_size_; }

 private:
  cv::Size image_size_;
  std::vector<BoardView> views_;
};

}  // namespace dynamic_slam
