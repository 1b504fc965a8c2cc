#pragma once

#include "dynamic_slam/tracking/tracker_options.h"

namespace dynamic_slam {

struct KeyframePolicyInput {
  int frames_since_keyframe = 0;
  int inliers = 0;            // landmarks that the frame tracks
  int most_inliers = 0;       // the most that a frame since the last keyframe did
  int keyframes_waiting = 0;  // that local mapping has not come to yet
};

enum class KeyframeReason : uint8_t {
  kNone,        // no keyframe
  kStart,       // one of the two that make a map
  kNewView,     // tracks too little of what was seen since the last keyframe
  kFewInliers,  // about to be lost
  kTime,        // long since the last one
};

const char* Name(KeyframeReason reason);

// Whether the frame should become a keyframe, and why. Pure.
KeyframeReason DecideKeyframe(const KeyframePolicyInput& input, const KeyframePolicyOptions& options);

}  // namespace dynamic_slam
