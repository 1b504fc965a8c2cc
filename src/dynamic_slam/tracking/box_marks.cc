#include "dynamic_slam/tracking/box_marks.h"

#include <cmath>
#include <limits>

#include "dynamic_slam/base/dispatch.h"

namespace dynamic_slam {
namespace {

// The least float that is not less: a float is below it exactly when it is below the double.
float RoundUp(double bound) {
  const auto nearest = static_cast<float>(bound);
  return nearest < bound ? std::nextafter(nearest, std::numeric_limits<float>::infinity()) : nearest;
}

DS_DISPATCH_AVX2
void MarkWithin(const float* x, const float* y, size_t count, float left, float top, float right,
                float bottom, uint32_t bits, uint32_t* marks) {
  for (size_t i = 0; i < count; ++i) {
    const bool is_in = (x[i] >= left) & (x[i] < right) & (y[i] >= top) & (y[i] < bottom);
    marks[i] |= is_in ? bits : 0;
  }
}

}  // namespace

void BoxMarks::Begin(const FeatureSet& features) {
  const size_t n = features.size();
  x_px_.resize(n);
  y_px_.resize(n);
  bits_.assign(n, 0);
  rows_.clear();
  for (size_t i = 0; i < n; ++i) {
    const Keypoint& keypoint = features.keypoints[i];
    x_px_[i] = keypoint.raw_x;
    y_px_[i] = keypoint.raw_y;
    if (rows_.empty() || rows_.back().octave != keypoint.octave) rows_.push_back({i, i, keypoint.octave});
    rows_.back().end = i + 1;
  }
}

void BoxMarks::Mark(const Box& box, double margin_px, std::span<const double> more_px, uint32_t bits) {
  for (const Row& row : rows_) {
    const double reach_px = margin_px + (more_px.empty() ? 0 : more_px[static_cast<size_t>(row.octave)]);
    MarkWithin(x_px_.data() + row.begin, y_px_.data() + row.begin, row.end - row.begin,
               RoundUp(box.x - reach_px), RoundUp(box.y - reach_px), RoundUp(box.x + box.width + reach_px),
               RoundUp(box.y + box.height + reach_px), bits, bits_.data() + row.begin);
  }
}

}  // namespace dynamic_slam
