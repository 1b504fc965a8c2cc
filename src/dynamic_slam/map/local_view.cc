#include "dynamic_slam/map/local_view.h"

#include <algorithm>
#include <cstddef>

namespace dynamic_slam {
namespace {

// Neighbours taken from each keyframe that sees the frame's landmarks.
constexpr size_t kNeighbours = 10;

// Landmarks lie anywhere in memory, so each is asked for some steps before it is read.
constexpr size_t kAhead = 12;

// Copies kept beside those in view, about as many as are in view: in a map that is only read they would
// become all of it.
constexpr size_t kMostCopiesBeside = 4000;

void FetchAhead(const Landmark* landmark) {
#ifdef __GNUC__
  constexpr size_t kCacheLine = 64;
  for (size_t at = 0; at < sizeof(Landmark); at += kCacheLine) {
    __builtin_prefetch(reinterpret_cast<const char*>(landmark) + at);
  }
#endif
}

}  // namespace

void LocalViewBuilder::Build(const Map& map, uint64_t writes, const std::vector<LandmarkId>& seen,
                             int max_keyframes, LocalView* view) {
  if (writes_ != writes || view->ids.size() > view->near.size() + kMostCopiesBeside) ForgetCopies(view);
  writes_ = writes;
  view->revision = map.revision();
  CountVotes(map, seen);
  ChooseKeyframes(map, static_cast<size_t>(max_keyframes), view);
  CollectLandmarks(map);
  CopyLandmarks(map, view);
}

void LocalViewBuilder::Copy(const Map& map, const std::vector<LandmarkId>& landmarks, LocalView* view) {
  ForgetCopies(view);
  writes_.reset();
  view->reference = KeyframeId();
  view->revision = map.revision();
  landmarks_ = landmarks;
  CopyLandmarks(map, view);
}

void LocalViewBuilder::CountVotes(const Map& map, const std::vector<LandmarkId>& seen) {
  votes_.resize(map.keyframes().CreatedCount());
  std::fill(votes_.begin(), votes_.end(), 0);
  for (const LandmarkId id : seen) {
    const Landmark* landmark = map.landmarks().Find(id);
    if (landmark == nullptr) continue;
    for (const Observation& observation : landmark->observations()) ++votes_[observation.keyframe.value()];
  }
}

void LocalViewBuilder::ChooseKeyframes(const Map& map, size_t limit, LocalView* view) {
  keyframes_.clear();
  view->reference = KeyframeId();
  int most_votes = 0;
  for (uint32_t i = 0; i < votes_.size(); ++i) {
    if (votes_[i] == 0) continue;
    keyframes_.emplace_back(i);
    if (votes_[i] >= most_votes) {  // the younger among equals
      most_votes = votes_[i];
      view->reference = KeyframeId(i);
    }
  }
  if (view->reference.IsValid()) {
    view->reference_from_world = map.keyframes().At(view->reference).cam_from_world();
    view->reference_unit = map.keyframes().At(view->reference).unit();
  }
  std::sort(keyframes_.begin(), keyframes_.end(), [this](KeyframeId a, KeyframeId b) {
    const int votes_a = votes_[a.value()], votes_b = votes_[b.value()];
    return votes_a != votes_b ? votes_a > votes_b : a < b;
  });
  if (keyframes_.size() > limit) keyframes_.resize(limit);
  const size_t direct = keyframes_.size();
  for (size_t i = 0; i < direct && keyframes_.size() < limit; ++i) {
    map.keyframes().At(keyframes_[i]).BestCovisible(kNeighbours, 1, &neighbours_);
    for (const CovisibleKeyframe& other : neighbours_) {
      if (votes_[other.id.value()] != 0 || keyframes_.size() >= limit) continue;
      votes_[other.id.value()] = -1;  // taken
      keyframes_.push_back(other.id);
    }
  }
}

void LocalViewBuilder::CollectLandmarks(const Map& map) {
  landmarks_.clear();
  is_taken_.resize((map.landmarks().CreatedCount() + 63) / 64 + 1);
  for (const KeyframeId keyframe : keyframes_) {
    const Keyframe& seen_from = map.keyframes().At(keyframe);
    fresh_.resize(std::max(fresh_.size(), seen_from.landmarks().size()));
    size_t count = 0;
    // Which landmark is new is hard to predict: no branch.
    seen_from.ForEachLandmark([&](uint32_t, LandmarkId id) {
      uint64_t& bits = is_taken_[id.value() / 64];
      fresh_[count] = id;
      count += 1 & ~(bits >> (id.value() % 64));
      bits |= uint64_t{1} << (id.value() % 64);
    });
    landmarks_.insert(landmarks_.end(), fresh_.begin(), fresh_.begin() + static_cast<std::ptrdiff_t>(count));
  }
  for (const LandmarkId id : landmarks_) is_taken_[id.value() / 64] = 0;
}

void LocalViewBuilder::CopyLandmarks(const Map& map, LocalView* view) {
  view->near.clear();
  copied_.clear();
  for (const LandmarkId id : landmarks_) {
    Slot& slot = slots_[id.value() % kSlots];
    if (slot.id != id) {
      slot = {id, static_cast<uint32_t>(view->ids.size())};
      view->ids.push_back(id);
      copied_.push_back(&map.landmarks().At(id));
    }
    view->near.push_back(slot.entry);
  }
  for (size_t i = 0; i < copied_.size(); ++i) {
    if (i + kAhead < copied_.size()) FetchAhead(copied_[i + kAhead]);
    const Landmark& landmark = *copied_[i];
    view->positions.push_back(landmark.position());
    view->normals.push_back(landmark.normal());
    view->spreads.push_back(landmark.spread());
    view->min_distances.push_back(landmark.min_distance());
    view->max_distances.push_back(landmark.max_distance());
    view->descriptors.push_back(landmark.descriptor());
    view->static_log_odds.push_back(landmark.static_log_odds);
  }
}

void LocalViewBuilder::ForgetCopies(LocalView* view) {
  slots_.resize(kSlots);  // the first time
  for (const LandmarkId id : view->ids) slots_[id.value() % kSlots] = {};
  view->ids.clear();
  view->positions.clear();
  view->normals.clear();
  view->spreads.clear();
  view->min_distances.clear();
  view->max_distances.clear();
  view->descriptors.clear();
  view->static_log_odds.clear();
}

}  // namespace dynamic_slam
