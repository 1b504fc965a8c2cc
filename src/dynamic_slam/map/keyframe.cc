#include "dynamic_slam/map/keyframe.h"

#include <algorithm>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

std::vector<CovisibleKeyframe> Keyframe::BestCovisible(size_t count, int min_weight) const {
  std::vector<CovisibleKeyframe> best;
  BestCovisible(count, min_weight, &best);
  return best;
}

void Keyframe::BestCovisible(size_t count, int min_weight, std::vector<CovisibleKeyframe>* best) const {
  best->clear();
  for (const CovisibleKeyframe& other : covisible_) {
    if (other.weight >= min_weight) best->push_back(other);
  }
  // Among equals the younger keyframe: it is the nearer in time.
  std::sort(best->begin(), best->end(), [](const CovisibleKeyframe& a, const CovisibleKeyframe& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.id > b.id;
  });
  if (best->size() > count) best->resize(count);
}

void Keyframe::SetLandmark(uint32_t keypoint, LandmarkId landmark) {
  DS_CHECK(landmarks_.at(keypoint).IsValid() != landmark.IsValid(), "keyframe={} keypoint={}", id_.value(),
           keypoint);
  landmarks_[keypoint] = landmark;
  has_landmark_[keypoint / 64] ^= uint64_t{1} << (keypoint % 64);
  landmark_count_ += landmark.IsValid() ? 1 : -1;
}

int Keyframe::WeightOf(KeyframeId other) const {
  const auto position = std::ranges::lower_bound(covisible_, other, {}, &CovisibleKeyframe::id);
  return position != covisible_.end() && position->id == other ? position->weight : 0;
}

void Keyframe::ChangeWeight(KeyframeId other, int change) {
  const auto position = std::ranges::lower_bound(covisible_, other, {}, &CovisibleKeyframe::id);
  if (position == covisible_.end() || position->id != other) {
    DS_CHECK(change > 0, "keyframe {} other {} change {}", id_.value(), other.value(), change);
    covisible_.insert(position, {other, change});
    return;
  }
  position->weight += change;
  DS_CHECK(position->weight >= 0, "keyframe {} other {}", id_.value(), other.value());
  if (position->weight == 0) covisible_.erase(position);
}

}  // namespace dynamic_slam
