#include "dynamic_slam/tracking/witnesses.h"

#include <algorithm>
#include <bit>

namespace dynamic_slam {

// Without branches for single keypoints, as which of them are candidates, known or followed is hard to
// predict.
void ChooseWitnesses(const Frame& frame, std::span<const uint32_t> candidates,
                     std::span<const uint32_t> last_keypoints, std::vector<uint32_t>* witnesses) {
  constexpr float kFollowed = 256;  // more than any FAST score
  witnesses->resize(frame.features.size());
  size_t count = 0;
  frame.grid.ForEachCell([&](std::span<const uint32_t> cell) {
    const size_t before = count;
    uint64_t best = 0;  // its worth and, as the first of equals is taken, the complement of its index
    for (const uint32_t i : cell) {
      const uint64_t is_candidate = candidates[i] != 0;
      const uint64_t speaks_for_itself = ((candidates[i] & kOfFew) != 0) | frame.landmarks[i].IsValid();
      const uint32_t was_followed = last_keypoints[i] != kNotFollowed;
      const float worth = frame.features.keypoints[i].response + kFollowed * static_cast<float>(was_followed);
      // The bits of numbers that are not negative are in their order.
      const uint64_t rank = uint64_t{std::bit_cast<uint32_t>(worth)} << 32 | ~i;
      best = std::max(best, rank & -is_candidate);
      (*witnesses)[count] = i;
      count += is_candidate & speaks_for_itself;
    }
    if (count == before && best != 0) (*witnesses)[count++] = ~static_cast<uint32_t>(best);
  });
  witnesses->resize(count);
}

void ShareInCells(const KeypointGrid& grid, std::span<const uint32_t> last_keypoints,
                  std::span<float> log_odds) {
  grid.ForEachCell([&](std::span<const uint32_t> cell) {
    float sum = 0;
    int followed = 0;
    for (const uint32_t i : cell) {
      const bool is_followed = last_keypoints[i] != kNotFollowed;
      sum += is_followed ? log_odds[i] : 0;
      followed += is_followed ? 1 : 0;
    }
    if (sum == 0) return;
    const float mean = sum / static_cast<float>(followed);
    for (const uint32_t i : cell) log_odds[i] = last_keypoints[i] != kNotFollowed ? log_odds[i] : mean;
  });
}

}  // namespace dynamic_slam
