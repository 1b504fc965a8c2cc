#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <opencv2/core.hpp>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/calibration/board_views.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// Images of a chessboard as a camera sees it, for tests: exact rays, 4 x 4 in each pixel.
class RenderedBoard {
 public:
  RenderedBoard(const Camera& camera, const Board& board) : camera_(camera), board_(board) {
    for (int y = 0; y < camera.height * kSamples; ++y) {
      for (int x = 0; x < camera.width * kSamples; ++x) {
        const Eigen::Vector2d raw((x + 0.5) / kSamples - 0.5, (y + 0.5) / kSamples - 0.5);
        rays_.push_back(camera.Unproject(camera.Undistort(raw)).cast<float>());
      }
    }
  }

  // Board frame: origin in the first inner corner, x along its columns. With noise of two grey levels.
  cv::Mat Render(const Rigid3& cam_from_board, Random* random) const {
    const Eigen::Matrix3f board_from_cam = cam_from_board.Matrix().transpose().cast<float>();
    const Eigen::Vector3f origin = board_from_cam * -cam_from_board.translation.cast<float>();
    cv::Mat1b image(camera_.height, camera_.width);
    for (int y = 0; y < camera_.height; ++y) {
      for (int x = 0; x < camera_.width; ++x) {
        float sum = 0;
        for (int dy = 0; dy < kSamples; ++dy) {
          for (int dx = 0; dx < kSamples; ++dx) {
            const size_t at =
                static_cast<size_t>((y * kSamples + dy) * camera_.width * kSamples + x * kSamples + dx);
            sum += Grey(origin, board_from_cam * rays_[at]);
          }
        }
        const double grey = sum / (kSamples * kSamples) + 2 * random->Gaussian();
        image(y, x) = static_cast<uchar>(std::clamp(std::lround(grey), 0l, 255l));
      }
    }
    return image;
  }

 private:
  static constexpr int kSamples = 4;

  float Grey(const Eigen::Vector3f& origin, const Eigen::Vector3f& ray) const {
    constexpr float kWall = 120, kWhite = 220, kBlack = 30;
    const float depth = -origin.z() / ray.z();
    if (!(depth > 0)) return kWall;
    const float square = static_cast<float>(board_.square_m);
    const float column = (origin.x() + depth * ray.x()) / square,
                row = (origin.y() + depth * ray.y()) / square;
    const float margin = 1.4f;  // one square about the inner corners, and white paper
    if (column < -margin || row < -margin || column > static_cast<float>(board_.columns - 1) + margin ||
        row > static_cast<float>(board_.rows - 1) + margin) {
      return kWall;
    }
    if (column < -1 || row < -1 || column > static_cast<float>(board_.columns) ||
        row > static_cast<float>(board_.rows)) {
      return kWhite;
    }
    const int parity = static_cast<int>(std::floor(column)) + static_cast<int>(std::floor(row));
    return parity % 2 == 0 ? kBlack : kWhite;
  }

  Camera camera_;
  Board board_;
  std::vector<Eigen::Vector3f> rays_;  // in cam, at depth 1, of each sample
};

}  // namespace dynamic_slam
