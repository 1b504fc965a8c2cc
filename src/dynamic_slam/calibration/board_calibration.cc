#include "dynamic_slam/calibration/board_calibration.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <opencv2/calib3d.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/calibration/board_coverage.h"

namespace dynamic_slam {
namespace {

constexpr double kMinTiltDeg = 15;
constexpr int kMinTiltedViews =
    4;  // a board that faces the camera does not tell the focal length from its distance
constexpr double kMinCoverage = 0.8;

struct Solution {
  Camera camera;
  std::vector<double> view_errors_px;  // root mean square, of each view
  std::vector<cv::Mat> rotations;      // cam_from_board, rotation vectors

  double Error() const {
    double sum = 0;
    for (const double error : view_errors_px) sum += error * error;
    return std::sqrt(sum / static_cast<double>(view_errors_px.size()));
  }
};

std::vector<cv::Point3f> CornersOnBoard(const Board& board) {
  std::vector<cv::Point3f> corners;
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      corners.emplace_back(static_cast<float>(column * board.square_m),
                           static_cast<float>(row * board.square_m), 0.f);
    }
  }
  return corners;
}

Camera ToCamera(const cv::Mat1d& K, const std::vector<double>& d, LensModel model, const cv::Size& size) {
  Camera camera;
  camera.width = size.width;
  camera.height = size.height;
  camera.fx = K(0, 0), camera.fy = K(1, 1), camera.cx = K(0, 2), camera.cy = K(1, 2);
  camera.model = model;
  camera.k1 = d[0], camera.k2 = d[1];
  if (model == LensModel::kKannalaBrandt) {
    camera.k3 = d[2], camera.k4 = d[3];
  } else {
    camera.p1 = d[2], camera.p2 = d[3], camera.k3 = d[4];
  }
  return camera;
}

Solution Solve(const std::vector<BoardView>& views, const Board& board, LensModel model,
               const cv::Size& size) {
  const std::vector<std::vector<cv::Point3f>> on_board(views.size(), CornersOnBoard(board));
  std::vector<std::vector<cv::Point2f>> seen;
  for (const BoardView& view : views) seen.push_back(view.corners);
  const bool is_fisheye = model == LensModel::kKannalaBrandt;
  cv::Mat1d K = cv::Mat1d::eye(3, 3);
  std::vector<double> distortion(is_fisheye ? 4 : 5);
  Solution solution;
  std::vector<cv::Mat> translations;
  const cv::TermCriteria until(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 200, 1e-12);
  if (is_fisheye) {
    // The middle of the image, and 60 deg at its edge: near enough to begin with.
    K(0, 0) = K(1, 1) = size.width / 2.0 / (std::numbers::pi / 3);
    K(0, 2) = (size.width - 1) / 2.0;
    K(1, 2) = (size.height - 1) / 2.0;
    cv::fisheye::calibrate(on_board, seen, size, K, distortion, solution.rotations, translations,
                           cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW |
                               cv::fisheye::CALIB_USE_INTRINSIC_GUESS,
                           until);
  } else {
    cv::Mat1d deviations;
    cv::calibrateCamera(on_board, seen, size, K, distortion, solution.rotations, translations, deviations,
                        cv::noArray(), cv::noArray(), 0, until);
    // Decentring looks much like another centre: where it is not certain to be there, it moves that by
    // pixels.
    constexpr double kCertain = 3;  // standard deviations
    constexpr size_t kP1 = 2, kIntrinsics = 4;
    const auto is_certain = [&](size_t p) {
      return std::abs(distortion[p]) > kCertain * deviations(static_cast<int>(kIntrinsics + p));
    };
    if (!is_certain(kP1) && !is_certain(kP1 + 1)) {
      cv::calibrateCamera(on_board, seen, size, K, distortion, solution.rotations, translations,
                          cv::CALIB_ZERO_TANGENT_DIST, until);
    }
  }
  solution.camera = ToCamera(K, distortion, model, size);
  for (size_t i = 0; i < views.size(); ++i) {
    std::vector<cv::Point2f> projected;
    if (is_fisheye) {
      cv::fisheye::projectPoints(on_board[i], projected, solution.rotations[i], translations[i], K,
                                 distortion);
    } else {
      cv::projectPoints(on_board[i], solution.rotations[i], translations[i], K, distortion, projected);
    }
    solution.view_errors_px.push_back(cv::norm(projected, seen[i], cv::NORM_L2) /
                                      std::sqrt(static_cast<double>(projected.size())));
  }
  return solution;
}

double TiltDeg(const cv::Mat& rotation_vector) {
  cv::Mat1d R;
  cv::Rodrigues(rotation_vector, R);
  return std::acos(std::clamp(std::abs(R(2, 2)), 0.0, 1.0)) * 180 / std::numbers::pi;
}

std::string Count(size_t n, const char* what) { return fmt::format("{} {}{}", n, what, n == 1 ? "" : "s"); }

}  // namespace

BoardCalibration CalibrateBoard(const BoardViews& views, const Board& board, LensModel model) {
  std::vector<BoardView> used = views.views();
  if (used.size() < kMinCalibrationViews) {
    throw InputError(
        "the calibration",
        fmt::format("the whole board is seen in {} that differ, and {} are needed",
                    Count(used.size(), "image"), kMinCalibrationViews),
        "Check --board (inner corners); show the board in all parts of the image, tilted, and without blur.");
  }
  BoardCalibration calibration;
  try {
    Solution solution = Solve(used, board, model, views.image_size());
    // Blurred views, and corners that were mistaken for others.
    std::vector<double> errors = solution.view_errors_px;
    std::nth_element(errors.begin(), errors.begin() + static_cast<ptrdiff_t>(errors.size() / 2),
                     errors.end());
    const double limit_px = 3 * errors[errors.size() / 2] + 0.1;
    std::vector<BoardView> kept;
    for (size_t i = 0; i < used.size(); ++i) {
      if (solution.view_errors_px[i] <= limit_px) {
        kept.push_back(used[i]);
      } else {
        calibration.left_out.push_back(used[i].name);
      }
    }
    if (kept.size() < used.size()) solution = Solve(kept, board, model, views.image_size());
    calibration.camera = solution.camera;
    calibration.error_px = solution.Error();
    for (const cv::Mat& rotation : solution.rotations)
      calibration.tilted_views += TiltDeg(rotation) >= kMinTiltDeg;
  } catch (const cv::Exception& error) {
    throw InputError("the calibration", fmt::format("no camera explains the views ({})", error.err),
                     "Check --board, and --fisheye for a lens with a wide view; take more images.");
  }
  calibration.camera.Validate();
  return calibration;
}

std::vector<std::string> MissingForCalibration(const BoardViews& views, const BoardCalibration& calibration) {
  std::vector<std::string> missing;
  const BoardCoverage coverage(views.views(), views.image_size());
  if (coverage.Share() < kMinCoverage) {
    missing.push_back(
        fmt::format("The board was seen in {:.0f} % of the image, and {:.0f} % are needed: show it in {}.",
                    100 * coverage.Share(), 100 * kMinCoverage, coverage.Missing()));
  }
  if (calibration.tilted_views < kMinTiltedViews) {
    missing.push_back(fmt::format(
        "The board is turned away from the camera by {} deg or more in {}, and {} are needed: "
        "tilt it to the left, to the right, up and down.",
        kMinTiltDeg, Count(static_cast<size_t>(calibration.tilted_views), "image"), kMinTiltedViews));
  }
  return missing;
}

}  // namespace dynamic_slam
