#include "dynamic_slam/mapping/local_mapper.h"

#include <algorithm>
#include <span>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/mapping/map_bundle.h"

namespace dynamic_slam {
namespace {

// A new landmark is on probation for so many keyframes: tracking must find it in a quarter of the frames
// where it should be visible, and after two keyframes a third must have seen it (Mur-Artal et al. 2015,
// section VI-B).
constexpr uint32_t kProbationKeyframes = 3;
constexpr double kMinFoundRatio = 0.25;
constexpr size_t kMinObservations = 3;

// Where landmarks are looked for that are one: in a keyframe's neighbours, and in theirs. Mapping has fused
// keyframes that follow each other when they came: what is still two there is mostly two, and on a road,
// where all is seen from ahead, merging it made errors up to 8% larger.
constexpr size_t kTwinNeighbours = 20, kTwinNextNeighbours = 5;
constexpr uint32_t kMinTwinDistance = 3;
constexpr int kTwinRounds = 2;

// Other keyframes that must see a landmark at the same or a finer scale for it to count as redundant.
constexpr int kRedundantViews = 3;

}  // namespace

LocalMapper::LocalMapper(const Camera& camera, const MapperOptions& options, SharedMap* map)
    : camera_(camera),
      options_(options),
      map_(map),
      factory_(camera, options),
      fusion_(camera, map->Read()->octave_scales()) {}

MappingResult LocalMapper::Process(KeyframeId keyframe, uint32_t epoch,
                                   const std::function<bool()>& should_stop) {
  DS_TRACE("mapping");
  if (epoch != epoch_) recent_landmarks_.clear();
  epoch_ = epoch;
  MappingResult result;
  const auto adjust = [&] {
    result.bundle = AdjustLocal(camera_, options_, keyframe, epoch_, should_stop, map_);
    return true;
  };
  const bool done = RefreshSeen(keyframe) && Change([&](Map* map) {
                      CullRecentLandmarks(keyframe, map, &result);
                      CullMovedLandmarks(keyframe, map, &result);
                    }) &&
                    CreateLandmarks(keyframe, &result) && FuseLandmarks(keyframe, &result) && adjust() &&
                    (!culls_keyframes_ || CullRedundantKeyframes(keyframe, &result));
  result.abandoned = !done;
  return result;
}

BundleSummary LocalMapper::Finish(const std::function<bool()>& should_stop) {
  BundleSummary summary = AdjustAll(camera_, options_, should_stop, map_);
  // What has moved together shows more that is twice.
  for (int round = 0; round < kTwinRounds && summary.usable && MergeTwins(should_stop) > 0; ++round)
    summary = AdjustAll(camera_, options_, should_stop, map_);
  return summary;
}

int LocalMapper::MergeTwins(const std::function<bool()>& should_stop) {
  DS_TRACE("mapping/merge twins");
  std::vector<KeyframeId> keyframes;
  map_->Read()->keyframes().ForEach([&](const Keyframe& keyframe) { keyframes.push_back(keyframe.id()); });
  int merged = 0;
  std::vector<KeyframeId> around;
  std::vector<LandmarkId> landmarks;
  for (const KeyframeId target : keyframes) {
    if (should_stop && should_stop()) break;
    const auto map = map_->Write();
    around.clear();
    for (const CovisibleKeyframe& neighbour : map->keyframes().At(target).BestCovisible(kTwinNeighbours)) {
      around.push_back(neighbour.id);
      for (const CovisibleKeyframe& next :
           map->keyframes().At(neighbour.id).BestCovisible(kTwinNextNeighbours))
        around.push_back(next.id);
    }
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    landmarks.clear();
    for (const KeyframeId id : around) {
      map->keyframes().At(id).ForEachLandmark(
          [&](uint32_t, LandmarkId landmark) { landmarks.push_back(landmark); });
    }
    std::sort(landmarks.begin(), landmarks.end());
    landmarks.erase(std::unique(landmarks.begin(), landmarks.end()), landmarks.end());
    merged += fusion_.MergeTwins(target, landmarks, kMinTwinDistance, map.get());
  }
  return merged;
}

// What tracking found in the keyframe looks a little different since; a few at a time, as tracking may wait.
bool LocalMapper::RefreshSeen(KeyframeId current) {
  DS_TRACE("mapping/refresh landmarks");
  constexpr size_t kAtATime = 50;
  std::vector<LandmarkId> seen;
  if (!Look([&](const Map& map) { seen = map.keyframes().At(current).landmarks(); })) return false;
  std::erase_if(seen, [](LandmarkId id) { return !id.IsValid(); });
  for (size_t begin = 0; begin < seen.size(); begin += kAtATime) {
    const auto some = std::span(seen).subspan(begin, std::min(kAtATime, seen.size() - begin));
    const bool is_there = Change([&](Map* map) {
      for (const LandmarkId id : some) {
        if (map->landmarks().Find(id) != nullptr) map->RefreshLandmark(id);
      }
    });
    if (!is_there) return false;
  }
  return true;
}

void LocalMapper::CullRecentLandmarks(KeyframeId current, Map* map, MappingResult* result) {
  DS_TRACE("mapping/cull landmarks");
  size_t kept = 0;
  for (const LandmarkId id : recent_landmarks_) {
    const Landmark* landmark = map->landmarks().Find(id);
    if (landmark == nullptr) continue;
    const uint32_t age = current.value() - landmark->created_by().value();
    const bool unseen = age >= 2 && landmark->observations().size() < kMinObservations;
    if (landmark->FoundRatio() < kMinFoundRatio || unseen) {
      map->EraseLandmark(id);
      ++result->culled_landmarks;
    } else if (age < kProbationKeyframes) {
      recent_landmarks_[kept++] = id;
    }
  }
  recent_landmarks_.resize(kept);
}

void LocalMapper::CullMovedLandmarks(KeyframeId current, Map* map, MappingResult* result) {
  std::vector<LandmarkId> moved;
  const auto neighbours =
      map->keyframes().At(current).BestCovisible(static_cast<size_t>(options_.fusion_neighbours));
  for (const CovisibleKeyframe& neighbour : neighbours) {
    map->keyframes().At(neighbour.id).ForEachLandmark([&](uint32_t, LandmarkId id) {
      const Landmark& landmark = map->landmarks().At(id);
      if (landmark.is_from_file && landmark.FoundRatio() < kMinFoundRatio) moved.push_back(id);
    });
  }
  for (const LandmarkId id : moved) {
    if (!map->landmarks().Contains(id)) continue;
    map->EraseLandmark(id);
    ++result->culled_landmarks;
  }
}

bool LocalMapper::CreateLandmarks(KeyframeId current, MappingResult* result) {
  DS_TRACE("mapping/create");
  std::vector<KeyframeId> neighbours;
  bool valid = Look([&](const Map& map) { neighbours = factory_.Neighbours(map, current); });
  for (size_t i = 0; valid && i < neighbours.size(); ++i) {
    std::vector<LandmarkProposal> proposals;
    uint32_t revision = 0;
    valid = Look([&](const Map& map) {
      revision = map.revision();
      proposals = factory_.Propose(map, current, neighbours[i]);
    });
    valid = valid && Change([&](Map* map) {
              if (map->revision() != revision) return;
              const std::vector<LandmarkId> added = LandmarkFactory::Add(proposals, map);
              recent_landmarks_.insert(recent_landmarks_.end(), added.begin(), added.end());
              result->created += static_cast<int>(added.size());
            });
  }
  return valid;
}

bool LocalMapper::FuseLandmarks(KeyframeId current, MappingResult* result) {
  DS_TRACE("mapping/fuse");
  std::vector<CovisibleKeyframe> neighbours;
  std::vector<LandmarkId> mine;
  bool valid = Look([&](const Map& map) {
    const Keyframe& keyframe = map.keyframes().At(current);
    neighbours = keyframe.BestCovisible(static_cast<size_t>(options_.fusion_neighbours));
    mine = keyframe.landmarks();
  });
  const auto fuse = [&](KeyframeId target, const std::vector<LandmarkId>& landmarks, Map* map) {
    result->merged_landmarks += fusion_.FuseInto(target, landmarks, map).merged;
  };
  for (size_t i = 0; valid && i < neighbours.size(); ++i) {
    valid = Change([&](Map* map) { fuse(neighbours[i].id, mine, map); });
  }
  for (size_t i = 0; valid && i < neighbours.size(); ++i) {
    valid = Change([&](Map* map) {
      const std::vector<LandmarkId> theirs = map->keyframes().At(neighbours[i].id).landmarks();
      fuse(current, theirs, map);
    });
  }
  return valid;
}

bool LocalMapper::CullRedundantKeyframes(KeyframeId current, MappingResult* result) {
  DS_TRACE("mapping/cull keyframes");
  std::vector<CovisibleKeyframe> neighbours;
  bool valid = Look([&](const Map& map) {
    neighbours = map.keyframes().At(current).BestCovisible(map.keyframes().size());
  });
  for (size_t i = 0; valid && i < neighbours.size(); ++i) {
    // Neither the origin of the world nor what still waits to be processed.
    const KeyframeId id = neighbours[i].id;
    if (current < id) continue;
    bool is_redundant = false;
    valid = Look([&](const Map& map) {
      is_redundant = !map.IsOrigin(id) && IsRedundant(map, map.keyframes().At(id));
    });
    if (!valid || !is_redundant) continue;
    valid = Change([&](Map* map) {
      map->EraseKeyframe(id, map->keyframes().At(id).BestCovisible(1).front().id);
      ++result->culled_keyframes;
    });
  }
  return valid;
}

bool LocalMapper::IsRedundant(const Map& map, const Keyframe& keyframe) const {
  int redundant = 0;
  keyframe.ForEachLandmark([&](uint32_t keypoint, LandmarkId landmark) {
    int views = 0;
    for (const Observation& other : map.landmarks().At(landmark).observations()) {
      if (other.keyframe == keyframe.id()) continue;
      views += map.keyframes().At(other.keyframe).keypoint(other.keypoint).octave <=
               keyframe.keypoint(keypoint).octave + 1;
    }
    redundant += views >= kRedundantViews;
  });
  const int landmarks = keyframe.LandmarkCount();
  return landmarks > 0 && redundant > options_.redundant_ratio * landmarks;
}

}  // namespace dynamic_slam
