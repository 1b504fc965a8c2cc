#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dynamic_slam/features/keypoint_grid.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// Stands for the keypoint of the last frame where there is none.
inline constexpr uint32_t kNotFollowed = 0xffffffffu;

// Bits of a keypoint: in or around a box that shows few cells of the grid, or in another one.
inline constexpr uint32_t kOfFew = 1, kOfMany = 2;

// The bit of a box. How an object moves is a median over its keypoints, and how it grows one over ten pairs
// of them in the middle half of its box (BoxMotionEstimator). With one keypoint of a cell, and a third of
// them found in the next frame, that takes sixty cells.
inline uint32_t WitnessesOf(const Box& box) {
  constexpr double kFewCells = 60;
  return box.Area() < kFewCells * KeypointGrid::kCellSizePx * KeypointGrid::kCellSizePx ? kOfFew : kOfMany;
}

// Of the candidates among a frame's keypoints (not 0), those that are asked how they move, for the others in
// their cells of the grid: what moves is a surface, and its keypoints tell nearly the same. All of few, and
// all that show a landmark, as the pose hangs on them; in a cell without, one: rather one that was followed
// from the last frame, as it knows more, and the strongest corner of these. last_keypoints: of each keypoint,
// the one of the last frame or kNotFollowed.
void ChooseWitnesses(const Frame& frame, std::span<const uint32_t> candidates,
                     std::span<const uint32_t> last_keypoints, std::vector<uint32_t>* witnesses);

// Gives keypoints that were not followed the mean log-odds of those in their cell that were. A cell is small,
// a third of a hand at 2 m: from the cells around it people came into maps (docs/benchmarks.md).
void ShareInCells(const KeypointGrid& grid, std::span<const uint32_t> last_keypoints,
                  std::span<float> log_odds);

}  // namespace dynamic_slam
