#include "dynamic_slam/loop/loop_closer.h"

#include <algorithm>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/loop/loop_correction.h"

namespace dynamic_slam {
namespace {

// Keyframes on either side of a loop in which landmarks are looked for twice.
constexpr size_t kFusedNeighbours = 10;

std::vector<KeyframeId> WithNeighbours(const Map& map, KeyframeId id) {
  std::vector<KeyframeId> keyframes{id};
  for (const CovisibleKeyframe& other : map.keyframes().At(id).BestCovisible(kFusedNeighbours)) {
    keyframes.push_back(other.id);
  }
  return keyframes;
}

}  // namespace

LoopCloser::LoopCloser(const Camera& camera, const LoopOptions& options, uint64_t seed, SharedMap* map)
    : camera_(camera),
      options_(options),
      map_(map),
      detector_(camera, options, map->Read()->octave_scales(), seed),
      fusion_(camera, map->Read()->octave_scales()),
      keyframes_since_loop_(options.min_keyframes_between) {}

LoopResult LoopCloser::Process(KeyframeId keyframe, uint32_t epoch,
                               const std::function<bool()>& should_stop) {
  DS_TRACE("loop");
  BeginEpoch(epoch);
  if (keyframes_since_loop_++ < options_.min_keyframes_between) return {};
  return ProcessNow(keyframe, epoch, should_stop);
}

LoopResult LoopCloser::ProcessNow(KeyframeId keyframe, uint32_t epoch,
                                  const std::function<bool()>& should_stop) {
  BeginEpoch(epoch);
  LoopResult result;
  const std::optional<Loop> loop = detector_.Detect(keyframe, epoch, *map_, &result.attempts);
  if (loop.has_value()) Close(*loop, should_stop, &result);
  return result;
}

LoopResult LoopCloser::Join(Loop loop, LoopAttempt attempt, uint32_t epoch,
                            const std::function<bool()>& should_stop) {
  DS_TRACE("loop/join");
  BeginEpoch(epoch);
  LoopResult result;
  {
    const auto map = map_->Read();
    const Keyframe* keyframe = map->keyframes().Find(loop.keyframe);
    const Keyframe* candidate = map->keyframes().Find(loop.candidate);
    if (map->epoch() != epoch || keyframe == nullptr || candidate == nullptr) return result;
    attempt.keyframe = loop.keyframe;
    attempt.candidate = loop.candidate;
    attempt.timestamp_s = keyframe->timestamp_s();
    attempt.candidate_timestamp_s = candidate->timestamp_s();
    attempt.inliers = static_cast<int>(loop.links.size());
    attempt.scale = loop.keyframe_from_candidate.scale;
    loop.landmarks = LandmarksOfPlace(*map, *candidate);
    loop.has_drifted = HasDrifted(*keyframe, *candidate, attempt.drift_px, options_);
  }
  result.attempts.push_back(attempt);
  if (attempt.reason.empty()) Close(loop, should_stop, &result);
  return result;
}

LoopResult LoopCloser::JoinAlike(PartId here, PartId there, const std::function<bool()>& should_stop) {
  BeginEpoch(map_->Read()->epoch());
  LoopResult result;
  const std::optional<Loop> loop = detector_.DetectAcross(here, there, *map_, should_stop, &result.attempts);
  if (loop.has_value()) Close(*loop, should_stop, &result);
  return result;
}

void LoopCloser::BeginEpoch(uint32_t epoch) {
  if (epoch == epoch_) return;
  epoch_ = epoch;
  loops_.clear();
  keyframes_since_loop_ = options_.min_keyframes_between;
}

void LoopCloser::Close(const Loop& loop, const std::function<bool()>& should_stop, LoopResult* result) {
  uint32_t revision = 0;
  const auto is_there = [&](const Map& map) {
    return map.epoch() == epoch_ && map.keyframes().Contains(loop.keyframe) &&
           map.keyframes().Contains(loop.candidate);
  };
  const auto is_one_part = [&](const Map& map) {
    return map.keyframes().At(loop.keyframe).part() == map.keyframes().At(loop.candidate).part();
  };
  bool joins = false;
  std::optional<LoopCorrection> correction;
  std::string& reason = result->attempts.back().reason;
  if (loop.has_drifted) {
    {
      const auto map = map_->Read();
      revision = map->revision();
      joins = is_there(*map) && !is_one_part(*map);
      if (is_there(*map) && !joins) correction.emplace(camera_, *map, loop, options_, loops_);
    }
    if (!joins && (!correction.has_value() || !correction->Solve(should_stop))) {
      reason = "the correction was stopped, or failed";
      return;
    }
  }
  const auto map = map_->Write();
  if (!is_there(*map) || (loop.has_drifted && map->revision() != revision)) {
    reason = "the map has changed meanwhile";
    return;
  }
  if (loop.has_drifted) {
    if (joins) {
      JoinParts(loop, map.get());
      result->joined = true;
    } else {
      correction->Apply(map.get());
    }
    loops_.emplace_back(loop.keyframe, loop.candidate);
    keyframes_since_loop_ = 0;
    result->corrected = true;
  }
  result->landmarks_merged = Merge(loop, map.get());
  result->linked = true;
}

void LoopCloser::JoinParts(const Loop& loop, Map* map) const {
  const Keyframe& keyframe = map->keyframes().At(loop.keyframe);
  const Keyframe& candidate = map->keyframes().At(loop.candidate);
  const Sim3 here_from_there = ToSim3(keyframe.cam_from_world()).Inverse() * loop.keyframe_from_candidate *
                               ToSim3(candidate.cam_from_world());
  const PartId here = keyframe.part(), there = candidate.part();
  if (here < there) {
    map->MergePart(there, here, here_from_there);
  } else {
    map->MergePart(here, there, here_from_there.Inverse());
  }
}

int LoopCloser::Merge(const Loop& loop, Map* map) {
  DS_TRACE("loop/merge");
  int merged = 0;
  for (const Loop::Link& link : loop.links) {
    const LandmarkId old = map->Resolve(link.landmark);
    if (!old.IsValid() || map->landmarks().At(old).IsSeenBy(loop.keyframe)) continue;
    const LandmarkId own = map->keyframes().At(loop.keyframe).landmarks()[link.keypoint];
    if (own.IsValid()) {
      map->MergeLandmarks(own, old);
      ++merged;
    } else {
      map->Link(loop.keyframe, link.keypoint, old);
      map->RefreshLandmark(old);
    }
  }
  const std::vector<KeyframeId> here = WithNeighbours(*map, loop.keyframe);
  const std::vector<KeyframeId> there = WithNeighbours(*map, loop.candidate);
  for (const KeyframeId keyframe : here) merged += fusion_.FuseInto(keyframe, loop.landmarks, map).merged;
  const std::vector<LandmarkId> own = map->keyframes().At(loop.keyframe).landmarks();
  for (const KeyframeId keyframe : there) merged += fusion_.FuseInto(keyframe, own, map).merged;
  return merged;
}

}  // namespace dynamic_slam
