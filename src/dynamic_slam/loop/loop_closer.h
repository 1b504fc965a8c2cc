#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "dynamic_slam/loop/loop_detector.h"
#include "dynamic_slam/loop/loop_options.h"
#include "dynamic_slam/map/landmark_fusion.h"
#include "dynamic_slam/map/shared_map.h"

namespace dynamic_slam {

struct LoopResult {
  std::vector<LoopAttempt> attempts;
  bool linked = false;     // the keyframe was linked to the old landmarks
  bool corrected = false;  // and the map was moved, so that they fit
  bool joined = false;     // and two parts of the map became one by it
  int landmarks_merged = 0;
};

// Looks for a loop at each keyframe that local mapping has done, and closes it: the essential graph is
// optimised over similarities, points move with their keyframes, landmarks that are one are merged. Where the
// old place is in another part of the map, the younger part is moved to it as it is.
// Synchronous; holds the map's lock for moments, and one to move everything. What mapping and tracking
// compute meanwhile from the map of before they drop, or put right (Map::revision).
class LoopCloser {
 public:
  LoopCloser(const Camera& camera, const LoopOptions& options, uint64_t seed, SharedMap* map);

  // `keyframe` was put into the map of this epoch. `should_stop` may be empty; when it says so, nothing is
  // corrected.
  LoopResult Process(KeyframeId keyframe, uint32_t epoch, const std::function<bool()>& should_stop = {});

  // The same, also where a loop was closed a few keyframes ago.
  LoopResult ProcessNow(KeyframeId keyframe, uint32_t epoch, const std::function<bool()>& should_stop = {});

  // Closes a loop of whose similarity another is sure; of it, the landmarks of the place and whether it has
  // drifted are found here. The attempt says how it was found; where it has a reason, it is no loop, and
  // nothing happens.
  LoopResult Join(Loop loop, LoopAttempt attempt, uint32_t epoch,
                  const std::function<bool()>& should_stop = {});

  // Joins two parts of the map where they show the same (LoopDetector::DetectAcross).
  LoopResult JoinAlike(PartId here, PartId there, const std::function<bool()>& should_stop = {});

 private:
  void BeginEpoch(uint32_t epoch);
  void Close(const Loop& loop, const std::function<bool()>& should_stop, LoopResult* result);
  void JoinParts(const Loop& loop, Map* map) const;
  int Merge(const Loop& loop, Map* map);

  Camera camera_;
  LoopOptions options_;
  SharedMap* map_;
  LoopDetector detector_;
  LandmarkFusion fusion_;
  // Of the epoch:
  uint32_t epoch_ = 0;
  int keyframes_since_loop_;
  std::vector<std::pair<KeyframeId, KeyframeId>> loops_;
};

}  // namespace dynamic_slam
