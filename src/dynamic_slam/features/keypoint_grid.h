#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>
#include <vector>

#include <Eigen/Core>

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

  size_t size() const { return cell_of_.size(); }

  // Calls fn(std::span<const uint32_t> indices) for each cell that has keypoints, row-major.
  template <class Fn>
  void ForEachCell(Fn&& fn) const {
    for (size_t k = 0; k < filled_count_; ++k) {
      const uint32_t cell = filled_[k];
      const uint32_t begin = cell_begin_[cell], end = cell_begin_[cell + 1];
      fn(std::span(index_.data() + begin, end - begin));
    }
  }

  // Calls fn(uint32_t index) for each keypoint at a distance <= radius_px from the ideal pixel (x, y) and of
  // an octave from min_octave to max_octave, and for no other, cell by cell (row-major), in a cell by index.
  // An empty grid, a negative radius or a NaN finds nothing. Always inlined: a function of its own would be
  // compiled for the plain processor only, and what fn does with it (base/dispatch.h).
  template <class Fn>
  __attribute__((always_inline)) void ForEachInWindow(float x, float y, float radius_px, int min_octave,
                                                      int max_octave, Fn&& fn) const {
    const float radius_squared = radius_px * radius_px;
    const Columns columns{Column(x - radius_px), Column(x + radius_px)};
    ForEachInRows(
        y - radius_px, y + radius_px, [&](int) __attribute__((always_inline)) { return columns; },
        [&](const Lanes& at_x, const Lanes& at_y, const Flags& octave) __attribute__((always_inline)) {
          const Lanes dx = at_x - x, dy = at_y - y;
          return (dx * dx + dy * dy <= radius_squared) & (octave >= min_octave) & (octave <= max_octave);
        },
        fn);
  }

  // The same for those at a distance <= radius_px from the line between two ideal pixels.
  template <class Fn>
  __attribute__((always_inline)) void ForEachAlong(const Eigen::Vector2f& a, const Eigen::Vector2f& b,
                                                   float radius_px, int min_octave, int max_octave,
                                                   Fn&& fn) const {
    const Eigen::Vector2f along = b - a;
    const float length_squared = along.squaredNorm();
    if (length_squared == 0) {  // a window costs less
      ForEachInWindow(a.x(), a.y(), radius_px, min_octave, max_octave, fn);
      return;
    }
    const float radius_squared = radius_px * radius_px;
    const float over = 1 / length_squared;
    const float reach_px = radius_px + 0.5f;  // more than the rounding of what follows
    ForEachInRows(
        std::min(a.y(), b.y()) - radius_px, std::max(a.y(), b.y()) + radius_px,
        // Of a line across rows and columns, a row of cells is near to a part only.
        [&](int row) __attribute__((always_inline)) {
          float enters = 0, leaves = 1;
          if (std::abs(along.y()) > 1) {
            enters = std::clamp((RowTop(row) - reach_px - a.y()) / along.y(), 0.0f, 1.0f);
            leaves = std::clamp((RowTop(row + 1) + reach_px - a.y()) / along.y(), 0.0f, 1.0f);
          }
          const float from = a.x() + enters * along.x(), to = a.x() + leaves * along.x();
          return Columns{Column(std::min(from, to) - reach_px), Column(std::max(from, to) + reach_px)};
        },
        [&](const Lanes& at_x, const Lanes& at_y, const Flags& octave) __attribute__((always_inline)) {
          constexpr Lanes kZero = {}, kOne = {1, 1, 1, 1};
          const Lanes dx = at_x - a.x(), dy = at_y - a.y();
          Lanes t = (dx * along.x() + dy * along.y()) * over;
          t = t < kZero ? kZero : t;
          t = t > kOne ? kOne : t;
          const Lanes off_x = dx - t * along.x(), off_y = dy - t * along.y();
          return (off_x * off_x + off_y * off_y <= radius_squared) & (octave >= min_octave) &
                 (octave <= max_octave);
        },
        fn);
  }

 private:
  // Numbers of some keypoints side by side; a comparison gives -1 where it is true, else 0. The compiler
  // makes of it what the processor has.
  static constexpr uint32_t kLanes = 4;
  using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));
  using Flags = int32_t __attribute__((vector_size(kLanes * sizeof(int32_t))));

  template <class To, class From>
  __attribute__((always_inline)) static To Load(const std::vector<From>& from, uint32_t begin) {
    To to;
    std::memcpy(&to, from.data() + begin, sizeof(to));
    return to;
  }

  struct Columns {
    int first, last;
  };

  // Bit k is that of lane k.
  __attribute__((always_inline)) static unsigned Bits(const Flags& flags) {
#ifdef __SSE2__
    return static_cast<unsigned>(__builtin_ia32_movmskps(reinterpret_cast<const Lanes&>(flags)));
#else
    unsigned bits = 0;
    for (uint32_t k = 0; k < kLanes; ++k) bits |= (flags[k] & 1u) << k;
    return bits;
#endif
  }

  // The lanes whose bits are set, in their order, before the others.
  __attribute__((always_inline)) static Flags MovedToFront(const Flags& lanes, unsigned bits) {
    static constexpr Flags kFrom[1u << kLanes] = {
        {0, 1, 2, 3}, {0, 1, 2, 3}, {1, 0, 2, 3}, {0, 1, 2, 3}, {2, 0, 1, 3}, {0, 2, 1, 3},
        {1, 2, 0, 3}, {0, 1, 2, 3}, {3, 0, 1, 2}, {0, 3, 1, 2}, {1, 3, 0, 2}, {0, 1, 3, 2},
        {2, 3, 0, 1}, {0, 2, 3, 1}, {1, 2, 3, 0}, {0, 1, 2, 3},
    };
#ifdef __clang__
    const Flags& from = kFrom[bits];
    return {lanes[from[0]], lanes[from[1]], lanes[from[2]], lanes[from[3]]};
#else
    return __builtin_shuffle(lanes, kFrom[bits]);
#endif
  }

  // Of the keypoints in the rows of cells that touch min_y to max_y, and there in columns_of_row(row), those
  // of which is_inside(x, y, octave) tells -1; it is asked about kLanes of them at a time.
  template <class ColumnsOfRow, class IsInside, class Fn>
  __attribute__((always_inline)) void ForEachInRows(float min_y, float max_y, ColumnsOfRow&& columns_of_row,
                                                    IsInside&& is_inside, Fn&& fn) const {
    if (size() == 0 || !(min_y <= max_y)) return;
    const int first_row = Row(min_y), last_row = Row(max_y);
    // Where keypoints are is hard to predict, so they are first found without a branch, then visited.
    constexpr size_t kMost = 128;
    uint32_t found[kMost];
    size_t count = 0;
    for (int row = first_row; row <= last_row; ++row) {
      const Columns columns = columns_of_row(row);
      // The cells of a row are neighbours in memory, so their keypoints are one range.
      const uint32_t begin = cell_begin_[row * columns_ + columns.first];
      const uint32_t end = cell_begin_[row * columns_ + columns.last + 1];
      for (uint32_t i = begin; i < end; i += kLanes) {
        if (count > kMost - kLanes) {
          for (size_t k = 0; k < count; ++k) fn(found[k]);
          count = 0;
        }
        // Keypoints of other cells may follow the last one.
        constexpr Flags kSteps = {0, 1, 2, 3};
        const Flags inside = is_inside(Load<Lanes>(x_, i), Load<Lanes>(y_, i), Load<Flags>(octave_, i)) &
                             (kSteps < static_cast<int32_t>(end - i));
        const unsigned bits = Bits(inside);
        const Flags first = MovedToFront(Load<Flags>(index_, i), bits);
        std::memcpy(found + count, &first, sizeof(first));
        count += static_cast<unsigned>(std::popcount(bits));
      }
    }
    for (size_t i = 0; i < count; ++i) fn(found[i]);
  }

  // Where a row of cells begins, ideal px. The first and the last row hold all that is above and below.
  float RowTop(int row) const {
    if (row == 0) return -std::numeric_limits<float>::infinity();
    if (row == rows_) return std::numeric_limits<float>::infinity();
    return min_y_ + kCellSizePx * static_cast<float>(row);
  }

  // Clamped before the conversion: far outside, the float does not fit an int. A NaN comes to cell 0.
  int Column(float x) const { return Cell((x - min_x_) * (1 / kCellSizePx), columns_); }
  int Row(float y) const { return Cell((y - min_y_) * (1 / kCellSizePx), rows_); }
  static int Cell(float cell, int cells) {
    return static_cast<int>(std::min(std::max(0.0f, cell), static_cast<float>(cells - 1)));
  }

  float min_x_ = 0, min_y_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<uint32_t> cell_begin_;  // columns * rows + 1
  std::vector<uint32_t> filled_;      // the first filled_count_: cells that have keypoints
  size_t filled_count_ = 0;           // so that copies are of one size and need no memory anew
  // Of the keypoints, cell by cell, and kLanes - 1 more that are nobody's.
  std::vector<float> x_, y_;  // ideal px
  std::vector<int32_t> octave_;
  std::vector<uint32_t> index_;
  std::vector<uint32_t> cell_of_;
};

}  // namespace dynamic_slam
