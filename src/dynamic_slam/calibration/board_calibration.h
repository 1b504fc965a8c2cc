#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "dynamic_slam/calibration/board_views.h"
#include "dynamic_slam/geometry/camera.h"

namespace dynamic_slam {

// A camera from views of a board, and how far it can be trusted.
struct BoardCalibration {
  Camera camera;
  double error_px = 0;                // root mean square distance of seen and projected corners
  int tilted_views = 0;               // in which the board is turned away by 15 deg or more
  std::vector<std::string> left_out;  // views that do not fit the others
};

inline constexpr size_t kMinCalibrationViews = 8;  // that differ

// After Zhang, "A flexible new technique for camera calibration" (2000), and for a fisheye Kannala and Brandt
// (2006), as OpenCV has them. Throws InputError when the views are too few or do not fit one camera.
BoardCalibration CalibrateBoard(const BoardViews& views, const Board& board, LensModel model);

// What the views lack for a calibration that holds all over the image, and what to do, in sentences; empty
// when nothing is missing.
std::vector<std::string> MissingForCalibration(const BoardViews& views, const BoardCalibration& calibration);

}  // namespace dynamic_slam
