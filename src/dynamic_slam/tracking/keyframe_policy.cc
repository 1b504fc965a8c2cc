#include "dynamic_slam/tracking/keyframe_policy.h"

namespace dynamic_slam {
namespace {

// Below so many landmarks every frame is worth a keyframe: new landmarks are what saves it.
constexpr int kFewInliers = 50;

}  // namespace

const char* Name(KeyframeReason reason) {
  switch (reason) {
    case KeyframeReason::kNone:
      return "none";
    case KeyframeReason::kStart:
      return "start";
    case KeyframeReason::kNewView:
      return "new view";
    case KeyframeReason::kFewInliers:
      return "few inliers";
    case KeyframeReason::kTime:
      return "time";
  }
  return "";
}

KeyframeReason DecideKeyframe(const KeyframePolicyInput& input, const KeyframePolicyOptions& options) {
  if (input.inliers < options.min_inliers || input.frames_since_keyframe < options.min_frames) {
    return KeyframeReason::kNone;
  }
  const bool is_poor = input.inliers < kFewInliers;
  if (input.keyframes_waiting >= (is_poor ? options.max_waiting_when_poor : options.max_waiting)) {
    return KeyframeReason::kNone;
  }
  if (input.inliers < options.max_tracked_ratio * input.most_inliers) return KeyframeReason::kNewView;
  if (is_poor) return KeyframeReason::kFewInliers;
  if (input.frames_since_keyframe >= options.max_frames) return KeyframeReason::kTime;
  return KeyframeReason::kNone;
}

}  // namespace dynamic_slam
