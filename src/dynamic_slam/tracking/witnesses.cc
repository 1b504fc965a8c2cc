#include "dynamic_slam/tracking/witnesses.h"

namespace dynamic_slam {

// Without branches for single keypoints, as which of them are candidates, known or followed is hard to
// predict.
void ChooseWitnesses(const Frame& frame, std::span<const uint8_t> candidates,
                     std::span<const uint32_t> last_keypoints, std::vector<uint32_t>* witnesses) {
  constexpr float kFollowed = 256;  // more than any FAST score
  witnesses->resize(frame.features.size());
  size_t count = 0;
  frame.grid.ForEachCell([&](std::span<const uint32_t> cell) {
    const size_t before = count;
    uint32_t best = 0;
    float most = -1;
    for (const uint32_t i : cell) {
      const bool speaks_for_itself = ((candidates[i] & kOfFew) != 0) | frame.landmarks[i].IsValid();
      const bool was_followed = !last_keypoints.empty() && last_keypoints[i] != kNotFollowed;
      const float worth = frame.features.keypoints[i].response + (was_followed ? kFollowed : 0);
      const bool is_better = (candidates[i] != 0) & (worth > most);
      best = is_better ? i : best;
      most = is_better ? worth : most;
      (*witnesses)[count] = i;
      count += static_cast<size_t>((candidates[i] != 0) & speaks_for_itself);
    }
    if (count == before && most >= 0) (*witnesses)[count++] = best;
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
