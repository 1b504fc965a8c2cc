#pragma once

#include "dynamic_slam/tracking/tracker_options.h"

namespace dynamic_slam {

struct KeyframePolicyInput {
  int frames_since_keyframe = 0;
  int inliers = 0;              // landmarks that the frame tracks
  int reference_landmarks = 0;  // well-observed landmarks of its reference keyframe
};

enum class KeyframeReason {
  kNone,         // no keyframe
  kNewView,      // tracks too little of what the reference keyframe sees
  kFewInliers,   // about to be lost
  kTime,         // long since the last one
};

const char* Name(KeyframeReason reason);

// Whether the frame should become a keyframe, and why. Pure.
KeyframeReason DecideKeyframe(const KeyframePolicyInput& input, const KeyframePolicyOptions& options);

}  // namespace dynamic_slam
