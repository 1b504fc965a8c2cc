#include "dynamic_slam/calibration/board_views.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

// Mean distance of the corners, px; a detector may begin at either end of the board.
double Distance(const BoardView& a, const BoardView& b) {
  double same = 0, turned = 0;
  const size_t n = a.corners.size();
  for (size_t i = 0; i < n; ++i) {
    same += cv::norm(a.corners[i] - b.corners[i]);
    turned += cv::norm(a.corners[i] - b.corners[n - 1 - i]);
  }
  return std::min(same, turned) / static_cast<double>(n);
}

}  // namespace

Board ParseBoard(const std::string& text, double square_m) {
  Board board;
  board.square_m = square_m;
  const char* const end = text.data() + text.size();
  const auto columns = std::from_chars(text.data(), end, board.columns);
  bool is_right = columns.ec == std::errc() && columns.ptr != end && *columns.ptr == 'x';
  if (is_right) {
    const auto rows = std::from_chars(columns.ptr + 1, end, board.rows);
    is_right = rows.ec == std::errc() && rows.ptr == end;
  }
  constexpr int kFewest = 3, kMost = 100;
  if (!is_right || std::min(board.columns, board.rows) < kFewest ||
      std::max(board.columns, board.rows) > kMost) {
    throw InputError(
        fmt::format("--board {}", text), "is not COLUMNSxROWS of inner corners",
        fmt::format("A board of 10 by 7 squares is 9x6; {} to {} are possible.", kFewest, kMost));
  }
  if (!(square_m > 0) || !std::isfinite(square_m)) {
    throw InputError(fmt::format("--square {}", square_m), "is no length",
                     "Give the edge of one square in m.");
  }
  return board;
}

std::optional<BoardView> FindBoard(const cv::Mat& grey, const Board& board, const std::string& name) {
  BoardView view{name, {}};
  if (!cv::findChessboardCornersSB(grey, cv::Size(board.columns, board.rows), view.corners,
                                   cv::CALIB_CB_NORMALIZE_IMAGE)) {
    return std::nullopt;
  }
  // Gradients about a corner say better where it is; no other corner may be near.
  double spacing_px = std::hypot(grey.cols, grey.rows);
  for (size_t i = 0; i + 1 < view.corners.size(); ++i) {
    spacing_px = std::min(spacing_px, cv::norm(view.corners[i] - view.corners[i + 1]));
    const size_t below = i + static_cast<size_t>(board.columns);
    if (below < view.corners.size())
      spacing_px = std::min(spacing_px, cv::norm(view.corners[i] - view.corners[below]));
  }
  const int reach_px = std::clamp(static_cast<int>(spacing_px / 3), 2, 10);
  cv::cornerSubPix(grey, view.corners, cv::Size(reach_px, reach_px), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-4));
  return view;
}

bool BoardViews::Add(BoardView view) {
  constexpr double kMinDistance = 0.03;  // of the image's diagonal
  const double min_px = kMinDistance * std::hypot(image_size_.width, image_size_.height);
  const bool is_new = std::none_of(views_.begin(), views_.end(),
                                   [&](const BoardView& known) { return Distance(known, view) < min_px; });
  if (is_new) views_.push_back(std::move(view));
  return is_new;
}

}  // namespace dynamic_slam
