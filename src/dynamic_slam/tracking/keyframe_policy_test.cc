#include "dynamic_slam/tracking/keyframe_policy.h"

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

constexpr KeyframePolicyOptions kOptions{
    .max_tracked_ratio = 0.9, .min_frames = 2, .max_frames = 30, .min_inliers = 15};

TEST(KeyframePolicyTest, Decides) {
  struct Case {
    const char* what;
    KeyframePolicyInput input;
    KeyframeReason reason;
  };
  const Case cases[] = {
      {"all is seen", {10, 200, 200}, KeyframeReason::kNone},
      {"just enough is seen", {10, 180, 200}, KeyframeReason::kNone},
      {"too little is seen", {10, 179, 200}, KeyframeReason::kNewView},
      {"too little is seen, but the last keyframe is fresh", {1, 100, 200}, KeyframeReason::kNone},
      {"too little is seen, and so little that the pose is doubtful", {10, 14, 200}, KeyframeReason::kNone},
      {"at the limit of doubt", {10, 15, 200}, KeyframeReason::kNewView},
      {"poor, though nothing was lost", {10, 40, 40}, KeyframeReason::kFewInliers},
      {"long ago", {30, 200, 200}, KeyframeReason::kTime},
      {"not quite so long ago", {29, 200, 200}, KeyframeReason::kNone},
      {"long ago, but doubtful", {300, 14, 14}, KeyframeReason::kNone},
      {"mapping is behind", {10, 100, 200, 3}, KeyframeReason::kNone},
      {"mapping is a little behind", {10, 100, 200, 2}, KeyframeReason::kNewView},
      {"mapping is behind, but there is danger", {10, 49, 200, 4}, KeyframeReason::kNewView},
      {"mapping is so far behind that danger does not count", {10, 49, 200, 5}, KeyframeReason::kNone},
      {"long ago, and mapping is behind", {30, 200, 200, 3}, KeyframeReason::kNone},
      {"the loss of view is the first reason", {30, 20, 200}, KeyframeReason::kNewView},
  };
  for (const Case& c : cases) EXPECT_STREQ(Name(DecideKeyframe(c.input, kOptions)), Name(c.reason)) << c.what;
}

}  // namespace
}  // namespace dynamic_slam
