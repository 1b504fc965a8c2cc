#include "dynamic_slam/features/keypoint_grid.h"

#include <cmath>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

void KeypointGrid::Build(const FeatureSet& features, const std::array<double, 4>& bounds) {
  const double width = bounds[2] - bounds[0], height = bounds[3] - bounds[1];
  DS_CHECK(width > 0 && height > 0 && width < 1e6 && height < 1e6, "width={} height={}", width, height);
  min_x_ = static_cast<float>(bounds[0]);
  min_y_ = static_cast<float>(bounds[1]);
  columns_ = static_cast<int>(std::ceil(width / kCellSizePx));
  rows_ = static_cast<int>(std::ceil(height / kCellSizePx));

  // Counting sort by cell; stable, so a cell's keypoints keep their order.
  const size_t count = features.size();
  const size_t cells = static_cast<size_t>(columns_) * rows_;
  cell_begin_.assign(cells + 1, 0);
  cell_of_.resize(count);
  for (size_t i = 0; i < count; ++i) {
    const Keypoint& keypoint = features.keypoints[i];
    cell_of_[i] = static_cast<uint32_t>(Row(keypoint.y) * columns_ + Column(keypoint.x));
    ++cell_begin_[cell_of_[i]];
  }
  filled_.resize(cells);
  filled_count_ = 0;
  uint32_t end = 0;
  for (uint32_t cell = 0; cell < cells; ++cell) {
    filled_[filled_count_] = cell;
    filled_count_ += cell_begin_[cell] > 0 ? 1 : 0;
    end += cell_begin_[cell];
    cell_begin_[cell] = end;
  }
  cell_begin_[cells] = end;
  const size_t padded = count + kLanes - 1;
  x_.resize(padded);
  y_.resize(padded);
  octave_.resize(padded);
  index_.resize(padded);
  // From the last one, so that the ends of cells become their beginnings.
  for (size_t i = count; i-- > 0;) {
    const Keypoint& keypoint = features.keypoints[i];
    const uint32_t place = --cell_begin_[cell_of_[i]];
    x_[place] = keypoint.x;
    y_[place] = keypoint.y;
    octave_[place] = keypoint.octave;
    index_[place] = static_cast<uint32_t>(i);
  }
}

}  // namespace dynamic_slam
