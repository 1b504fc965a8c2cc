#include "dynamic_slam/map/local_view.h"

#include <algorithm>
#include <bit>

namespace dynamic_slam {
namespace {

// Neighbours taken from each keyframe that sees the frame's landmarks.
constexpr size_t kNeighbours = 10;

// Landmarks lie anywhere in memory, so each is asked for some steps before it is read.
constexpr size_t kAhead = 12;

void FetchAhead(const Landmark* landmark) {
#ifdef __GNUC__
  constexpr size_t kCacheLine = 64;
  for (size_t at = 0; at < sizeof(Landmark); at += kCacheLine) {
    __builtin_prefetch(reinterpret_cast<const char*>(landmark) + at);
  }
#endif
}

}  // namespace

void LocalViewBuilder::CopiedSet::Begin(size_t most) {
  ++build_;
  if (entries_.size() >= 2 * most && !entries_.empty()) return;
  entries_.assign(std::bit_ceil(std::max<size_t>(2 * most, 1024)), {});
  shift_ = 32 - std::countr_zero(entries_.size());
}

bool LocalViewBuilder::CopiedSet::Add(LandmarkId id) {
  const size_t mask = entries_.size() - 1;
  // Fibonacci hashing (Knuth, The Art of Computer Programming 3, 6.4): ids that follow each other lie apart.
  for (size_t at = (id.value() * 2654435769u) >> shift_;; at = (at + 1) & mask) {
    Entry& entry = entries_[at];
    if (entry.build != build_) {
      entry = {id, build_};
      return true;
    }
    if (entry.id == id) return false;
  }
}

void LocalViewBuilder::Build(const Map& map, const std::vector<LandmarkId>& seen, int max_keyframes,
                             LocalView* view) {
  view->ids.clear();
  view->positions.clear();
  view->normals.clear();
  view->spreads.clear();
  view->min_distances.clear();
  view->max_distances.clear();
  view->descriptors.clear();
  view->static_log_odds.clear();
  view->reference = KeyframeId();
  view->revision = map.revision();

  votes_.resize(map.keyframes().CreatedCount());
  std::fill(votes_.begin(), votes_.end(), 0);
  for (const LandmarkId id : seen) {
    const Landmark* landmark = map.landmarks().Find(id);
    if (landmark == nullptr) continue;
    for (const Observation& observation : landmark->observations()) ++votes_[observation.keyframe.value()];
  }
  keyframes_.clear();
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
  const size_t limit = static_cast<size_t>(max_keyframes);
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

  copied_.Begin(map.landmarks().size());
  landmarks_.clear();
  for (const KeyframeId keyframe : keyframes_) {
    for (const LandmarkId id : map.keyframes().At(keyframe).landmarks()) {
      if (!id.IsValid() || !copied_.Add(id)) continue;
      landmarks_.push_back(&map.landmarks().At(id));
      view->ids.push_back(id);
    }
  }
  for (size_t i = 0; i < landmarks_.size(); ++i) {
    if (i + kAhead < landmarks_.size()) FetchAhead(landmarks_[i + kAhead]);
    const Landmark& landmark = *landmarks_[i];
    view->positions.push_back(landmark.position());
    view->normals.push_back(landmark.normal());
    view->spreads.push_back(landmark.spread());
    view->min_distances.push_back(landmark.min_distance());
    view->max_distances.push_back(landmark.max_distance());
    view->descriptors.push_back(landmark.descriptor());
    view->static_log_odds.push_back(landmark.static_log_odds);
  }
}

}  // namespace dynamic_slam
