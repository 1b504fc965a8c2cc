#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dynamic_slam/features/features.h"

namespace dynamic_slam {

// Finds the keypoints near an ideal pixel: square cells over the image, their keypoints one after the other
// in one array (compressed sparse rows). Rebuilt for each image; keeps its buffers.
class KeypointGrid {
 public:
  static constexpr float kCellSizePx = 16;

  // bounds: {min_x, min_y, max_x, max_y} in ideal px (Camera::IdealBounds), of positive width and height.
  // Keypoints outside go to the nearest border cell and are found all the same.
  void Build(const FeatureSet& features, const std::array<double, 4>& bounds);

  size_t size() const { return entries_.size(); }

  // Calls fn(uint32_t index) for each keypoint at a distance <= radius_px from the ideal pixel (x, y) and of
  // an octave from min_octave to max_octave, and for no other, cell by cell (row-major), in a cell by index.
  // An empty grid, a negative radius or a NaN finds nothing. Always inlined: a function of its own would be
  // compiled for the plain processor only, and what fn does with it (base/dispatch.h).
  template <class Fn>
  __attribute__((always_inline)) void ForEachInWindow(float x, float y, float radius_px, int min_octave,
                                                      int max_octave, Fn&& fn) const {
    if (entries_.empty() || !(radius_px >= 0) || x != x || y != y || min_octave > max_octave) return;
    const int first_column = Column(x - radius_px), last_column = Column(x + radius_px);
    const int first_row = Row(y - radius_px), last_row = Row(y + radius_px);
    const float radius_squared = radius_px * radius_px;
    // Where keypoints are is hard to predict, so they are first found without a branch, then visited.
    constexpr size_t kMost = 128;
    uint32_t found[kMost];
    size_t count = 0;
    for (int row = first_row; row <= last_row; ++row) {
      // The cells of a row are neighbours in memory, so their keypoints are one range.
      const uint32_t begin = cell_begin_[row * columns_ + first_column];
      const uint32_t end = cell_begin_[row * columns_ + last_column + 1];
      for (uint32_t i = begin; i < end; ++i) {
        const Entry& entry = entries_[i];
        const float dx = entry.x - x, dy = entry.y - y;
        found[count] = entry.index;
        count += static_cast<size_t>((dx * dx + dy * dy <= radius_squared) & (entry.octave >= min_octave) &
                                     (entry.octave <= max_octave));
        if (count == kMost) {
          for (const uint32_t index : found) fn(index);
          count = 0;
        }
      }
    }
    for (size_t i = 0; i < count; ++i) fn(found[i]);
  }

 private:
  struct Entry {
    float x, y;  // ideal px; copied here so that a query reads one array only
    uint32_t index;
    int octave;
  };

  // Clamped before the conversion: far outside, the float does not fit an int.
  int Column(float x) const { return Cell((x - min_x_) * (1 / kCellSizePx), columns_); }
  int Row(float y) const { return Cell((y - min_y_) * (1 / kCellSizePx), rows_); }
  static int Cell(float cell, int cells) {
    return static_cast<int>(std::clamp(cell, 0.0f, static_cast<float>(cells - 1)));
  }

  float min_x_ = 0, min_y_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<uint32_t> cell_begin_;  // columns * rows + 1
  std::vector<Entry> entries_;
  std::vector<uint32_t> cell_of_, next_;
};

}  // namespace dynamic_slam
