#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dynamic_slam/features/features.h"
#include "dynamic_slam/features/keypoint_grid.h"

namespace dynamic_slam {

// Distances of steered BRIEF descriptors, in bits: two unrelated ones lie 123 apart in the mean, and 95% of the pairs of
// one point below 54. The loose limit serves where geometry leaves few candidates.
inline constexpr int kStrictDistance = 60;
inline constexpr int kLooseDistance = 100;

// A window of the image and of the pyramid in which to look for a descriptor.
struct SearchWindow {
  float x = 0, y = 0;  // ideal px
  float radius_px = 0;
  int min_octave = 0, max_octave = 0;
};

struct WindowMatch {
  static constexpr uint32_t kNone = 0xffffffffu;
  uint32_t keypoint = kNone;
  int distance = 257;         // of the best keypoint
  int second_distance = 257;  // of the second best
  int octave = -1, second_octave = -2;

  bool Found() const { return keypoint != kNone; }
};

// The nearest keypoints of `features` to the descriptor among those in the window with taken[keypoint] == 0.
// `taken` may be empty: all are free.
WindowMatch FindInWindow(const FeatureSet& features, const KeypointGrid& grid, const SearchWindow& window,
                         const Descriptor& descriptor, std::span<const uint8_t> taken);

struct Match {
  uint32_t first = 0, second = 0;  // indices of keypoints
  int distance = 0;
};

// Mutually nearest descriptors between two lists of keypoints, at most max_distance apart and nearer than
// `ratio` times the second best. In the order of first_indices.
std::vector<Match> MatchMutual(const FeatureSet& first, std::span<const uint32_t> first_indices,
                               const FeatureSet& second, std::span<const uint32_t> second_indices,
                               int max_distance, double ratio);

// A camera that turns about its axis turns all keypoints by the same angle: a match is believed when the
// angle between its keypoints lies in the fullest of 30 bins or next to it.
class RotationConsistency {
 public:
  void Clear() { differences_.clear(); }
  void Add(float first_angle_rad, float second_angle_rad) {
    differences_.push_back(first_angle_rad - second_angle_rad);
  }

  // keep[i] is 1 when the i-th pair added agrees with the others. Valid until the next call.
  const std::vector<uint8_t>& Judge();

 private:
  std::vector<float> differences_;
  std::vector<uint8_t> keep_;
  std::vector<int> bins_;
};

}  // namespace dynamic_slam
