#include "dynamic_slam/features/undistortion_table.h"

#include <algorithm>

namespace dynamic_slam {

UndistortionTable::UndistortionTable(const Camera& camera) {
  if (!camera.HasDistortion()) return;
  columns_ = (camera.width - 1) / kStepPx + 2;
  const int rows = (camera.height - 1) / kStepPx + 2;
  shifts_.reserve(static_cast<size_t>(columns_) * rows);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns_; ++column) {
      const Eigen::Vector2d raw(column * kStepPx, row * kStepPx);
      const Eigen::Vector2d shift = camera.Undistort(raw) - raw;
      shifts_.push_back({static_cast<float>(shift.x()), static_cast<float>(shift.y())});
    }
  }
}

void UndistortionTable::Undistort(float* x, float* y) const {
  if (shifts_.empty()) return;
  const float column = std::max(0.0f, *x / kStepPx), row = std::max(0.0f, *y / kStepPx);
  const int i = std::min(static_cast<int>(column), columns_ - 2);
  const int j = std::min(static_cast<int>(row), static_cast<int>(shifts_.size()) / columns_ - 2);
  const float u = column - static_cast<float>(i), v = row - static_cast<float>(j);
  const Shift* upper = shifts_.data() + static_cast<size_t>(j) * columns_ + i;
  const Shift* lower = upper + columns_;
  const float a = (1 - u) * (1 - v), b = u * (1 - v), c = (1 - u) * v, d = u * v;
  *x += a * upper[0].x + b * upper[1].x + c * lower[0].x + d * lower[1].x;
  *y += a * upper[0].y + b * upper[1].y + c * lower[0].y + d * lower[1].y;
}

}  // namespace dynamic_slam
