#pragma once

#include <deque>
#include <span>
#include <utility>

#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/semantics/frame_objects.h"
#include "dynamic_slam/tracking/dynamic_filter.h"
#include "dynamic_slam/tracking/initializer.h"

namespace dynamic_slam {

// What a detector tells late of people whom nobody knew of: the frames since are gone, but keyframes and
// first views are not. Their keypoints are judged again, and landmarks that were made of what moves are
// erased, so that tracking does not go on to follow it. Not in the paper, whose detector is never late.
class LateJudgement {
 public:
  // A keyframe that was made of a frame.
  void Remember(FrameId frame, KeyframeId keyframe);

  void Judge(std::span<const LateObjects> late, const DynamicFilter& filter, Initializer* initializer,
             SharedMap* map);

  void Reset() { recent_.clear(); }

 private:
  void JudgeKeyframe(KeyframeId id, KeyframeId oldest, std::span<const DynamicBox> boxes,
                     const DynamicFilter& filter, Map* map) const;

  std::deque<std::pair<FrameId, KeyframeId>> recent_;  // oldest first
};

}  // namespace dynamic_slam
