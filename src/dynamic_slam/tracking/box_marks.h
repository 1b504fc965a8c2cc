#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynamic_slam/features/features.h"
#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// Marks on a frame's keypoints by the boxes that they are in. Thousands of keypoints and some boxes of people
// who fill the view: positions lie side by side, so that many are compared at a time.
class BoxMarks {
 public:
  // Nobody has a mark.
  void Begin(const FeatureSet& features);

  // Sets the bits of the keypoints in the box (raw px) and of those at most margin_px outside, and of each
  // octave so much more (px; empty: none). As Box::Contains says.
  void Mark(const Box& box, double margin_px, std::span<const double> more_px, uint32_t bits);

  // Of each keypoint.
  std::span<const uint32_t> bits() const { return bits_; }

 private:
  struct Row {  // of keypoints of one octave
    size_t begin, end;
    int octave;
  };

  std::vector<float> x_px_, y_px_;
  std::vector<uint32_t> bits_;
  std::vector<Row> rows_;
};

}  // namespace dynamic_slam
