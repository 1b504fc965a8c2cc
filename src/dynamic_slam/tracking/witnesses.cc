#include "dynamic_slam/tracking/witnesses.h"

#include <utility>

namespace dynamic_slam {

void ChooseWitnesses(const Frame& frame, std::span<const uint8_t> candidates,
                     std::span<const uint32_t> last_keypoints, std::vector<uint32_t>* witnesses) {
  witnesses->clear();
  const auto worth = [&](uint32_t i) {
    const bool was_followed = !last_keypoints.empty() && last_keypoints[i] != kNotFollowed;
    return std::pair(was_followed, frame.features.keypoints[i].response);
  };
  frame.grid.ForEachCell([&](std::span<const uint32_t> cell) {
    constexpr uint32_t kNone = 0xffffffffu;
    const size_t before = witnesses->size();
    uint32_t best = kNone;
    for (const uint32_t i : cell) {
      if (candidates[i] == 0) continue;
      if (frame.landmarks[i].IsValid()) {
        witnesses->push_back(i);
      } else if (best == kNone || worth(i) > worth(best)) {
        best = i;
      }
    }
    if (witnesses->size() == before && best != kNone) witnesses->push_back(best);
  });
}

void ShareInCells(const KeypointGrid& grid, std::span<const uint32_t> last_keypoints,
                  std::span<float> log_odds) {
  grid.ForEachCell([&](std::span<const uint32_t> cell) {
    float sum = 0;
    int followed = 0;
    for (const uint32_t i : cell) {
      if (last_keypoints[i] == kNotFollowed) continue;
      sum += log_odds[i];
      ++followed;
    }
    if (sum == 0) return;
    const float mean = sum / static_cast<float>(followed);
    for (const uint32_t i : cell) {
      if (last_keypoints[i] == kNotFollowed) log_odds[i] = mean;
    }
  });
}

}  // namespace dynamic_slam
