#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dynamic_slam/features/fast_detector.h"

namespace dynamic_slam {

// Shares `wanted` over the levels in proportion to `weights`; what a level has too few corners for goes to
// the others in the same proportion. shares: counts <= available, whose sum is min(wanted, sum of available).
void ShareOverLevels(int wanted, const std::vector<double>& weights, const std::vector<int>& available,
                     std::vector<int>* shares);

// Chooses strong corners that are evenly spread: square cells of about the area that one wanted corner has,
// first the strongest corner of each cell, then the second strongest, and so on. In a round that does not fit
// as a whole the strongest go first (then the upper, then the left one). Keeps its buffers.
class CornerSelector {
 public:
  // corners: of a level of width x height px, sorted by y, then x. Keeps `wanted` of them, in order of y,
  // then x. A corner with score <= weak_score comes one round later: rather a second good corner than a weak
  // one. rounds_late: empty, or by how many rounds each corner comes later beside that.
  void Select(int width, int height, int wanted, int weak_score, std::span<const uint8_t> rounds_late,
              std::vector<Corner>* corners);

 private:
  std::vector<uint32_t> by_score_;  // indices of corners, strongest first
  std::vector<uint16_t> in_cell_;   // corners seen per cell
  std::vector<uint16_t> round_;     // per corner
  std::vector<uint32_t> in_round_;  // corners per round
};

}  // namespace dynamic_slam
