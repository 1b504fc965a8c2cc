#include "dynamic_slam/features/matcher.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "dynamic_slam/base/dispatch.h"

namespace dynamic_slam {
namespace {

struct Nearest {
  int distance = 257, second = 257;
  uint32_t position = 0;  // in the list of indices
};

DS_DISPATCH_POPCNT
void FindNearest(const Descriptor* first, size_t first_count, const Descriptor* second, size_t second_count,
                 Nearest* nearest_of_first, Nearest* nearest_of_second) {
  for (uint32_t i = 0; i < first_count; ++i) {
    Nearest best;
    for (uint32_t j = 0; j < second_count; ++j) {
      const int distance = HammingDistance(first[i], second[j]);
      if (distance < best.distance) {
        best = {distance, best.distance, j};
      } else if (distance < best.second) {
        best.second = distance;
      }
      if (distance < nearest_of_second[j].distance) nearest_of_second[j] = {distance, 0, i};
    }
    nearest_of_first[i] = best;
  }
}

std::vector<Descriptor> Gather(const FeatureSet& features, std::span<const uint32_t> indices) {
  std::vector<Descriptor> descriptors(indices.size());
  for (size_t i = 0; i < indices.size(); ++i) descriptors[i] = features.descriptors[indices[i]];
  return descriptors;
}

}  // namespace

DS_DISPATCH_POPCNT
WindowMatch FindInWindow(const FeatureSet& features, const KeypointGrid& grid, const SearchWindow& window,
                         const Descriptor& descriptor, std::span<const uint8_t> taken) {
  // Which of them is nearer is as hard to predict, so the two nearest are kept without a branch: as numbers
  // of the distance, the order in which they were found, which decides between equals, and the keypoint.
  constexpr int kDistanceBit = 55, kOrderBit = 32;
  constexpr uint64_t kNobody = ~uint64_t{0};
  uint64_t best = kNobody, second = kNobody, order = 0;
  const auto visit = [&](uint32_t index) __attribute__((always_inline)) {
    const auto distance = static_cast<uint64_t>(HammingDistance(descriptor, features.descriptors[index]));
    uint64_t rank = distance << kDistanceBit | order | index;
    if (!taken.empty()) rank |= -uint64_t{taken[index] != 0};
    order += uint64_t{1} << kOrderBit;
    second = std::min(second, std::max(best, rank));
    best = std::min(best, rank);
  };
  grid.ForEachInWindow(window.x, window.y, window.radius_px, window.min_octave, window.max_octave, visit);
  WindowMatch match;
  if (best == kNobody) return match;
  match.keypoint = static_cast<uint32_t>(best);
  match.distance = static_cast<int>(best >> kDistanceBit);
  match.octave = features.keypoints[match.keypoint].octave;
  if (second == kNobody) return match;
  match.second_distance = static_cast<int>(second >> kDistanceBit);
  match.second_octave = features.keypoints[static_cast<uint32_t>(second)].octave;
  return match;
}

std::vector<Match> MatchMutual(const FeatureSet& first, std::span<const uint32_t> first_indices,
                               const FeatureSet& second, std::span<const uint32_t> second_indices,
                               int max_distance, double ratio) {
  const std::vector<Descriptor> first_descriptors = Gather(first, first_indices);
  const std::vector<Descriptor> second_descriptors = Gather(second, second_indices);
  std::vector<Nearest> of_first(first_indices.size()), of_second(second_indices.size());
  FindNearest(first_descriptors.data(), first_descriptors.size(), second_descriptors.data(),
              second_descriptors.size(), of_first.data(), of_second.data());
  std::vector<Match> matches;
  for (uint32_t i = 0; i < first_indices.size(); ++i) {
    const Nearest& nearest = of_first[i];
    if (nearest.distance > max_distance || nearest.distance >= ratio * nearest.second) continue;
    if (of_second[nearest.position].position != i) continue;
    matches.push_back({first_indices[i], second_indices[nearest.position], nearest.distance});
  }
  return matches;
}

const std::vector<uint8_t>& RotationConsistency::Judge() {
  constexpr int kBins = 30;
  constexpr float kTwoPi = 2.0f * std::numbers::pi_v<float>;
  std::array<int, kBins> histogram{};
  bins_.resize(differences_.size());
  for (size_t i = 0; i < differences_.size(); ++i) {
    const float turns = differences_[i] / kTwoPi;
    bins_[i] = static_cast<int>((turns - std::floor(turns)) * kBins) % kBins;
    ++histogram[static_cast<size_t>(bins_[i])];
  }
  // The rotation lies somewhere in the fullest bin, so its spread reaches both neighbours.
  const int fullest =
      static_cast<int>(std::max_element(histogram.begin(), histogram.end()) - histogram.begin());
  keep_.resize(differences_.size());
  for (size_t i = 0; i < differences_.size(); ++i) {
    const int apart = (bins_[i] - fullest + kBins) % kBins;
    keep_[i] = apart <= 1 || apart == kBins - 1;
  }
  return keep_;
}

}  // namespace dynamic_slam
