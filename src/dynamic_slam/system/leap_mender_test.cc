#include "dynamic_slam/system/leap_mender.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

// A camera that moves sideways past a map, 0.2 units a second, 20 frames a second.
class LeapMenderTest : public testing::Test {
 protected:
  static constexpr int kFrames = 100;
  static constexpr double kAway = 0.3;

  LeapMenderTest() {
    for (const double x : {0.0, 0.5, 1.0}) keyframes_.push_back(scene_.Add(SidewaysPose(x)));
    scene_.AddLandmarks(0, static_cast<uint32_t>(world_.size()), keyframes_);
  }

  static double StampOf(int i) { return 0.05 * i; }

  // Frame i, seen from seen_x, is tracked to be at tracked_x.
  void Track(int i, double seen_x, double tracked_x) {
    Frame frame = world_.See(SidewaysPose(seen_x)).frame;
    frame.id = FrameId(static_cast<uint32_t>(i));
    frame.timestamp_s = StampOf(i);
    kept_.Keep(frame, 40);
    tracked_.Add({StampOf(i), keyframes_[0], SidewaysPose(tracked_x)}, true);
  }

  // All of them where they are, but those from first to last.
  void GoAstray(int first, int last) {
    for (int i = 0; i < kFrames; ++i) {
      const bool is_astray = i >= first && i <= last;
      Track(i, 0.01 * i, 0.01 * i + (is_astray ? kAway : 0));
    }
  }

  double ErrorAt(const StampedPose& pose) const {
    return (pose.world_from_cam.translation - Eigen::Vector3d(0.2 * pose.timestamp_s, 0, 0)).norm();
  }

  SyntheticWorld world_{600};
  SyntheticMap scene_{&world_};
  std::vector<KeyframeId> keyframes_;
  TrackerOptions options_;
  PoseRefiner kept_{world_.camera(), options_, &scene_.shared_map};
  TrackedFrames tracked_{&scene_.shared_map};
  LeapMender mender_{world_.camera(), options_, 1, kept_, &tracked_, &scene_.shared_map};
};

TEST_F(LeapMenderTest, AnEndThatWentAstrayIsFoundInTheRest) {
  GoAstray(50, 55);
  ASSERT_TRUE(tracked_.Leaps());
  EXPECT_GT(mender_.MendEnds({}), 0);
  EXPECT_FALSE(tracked_.Leaps());
  const Trajectory path = tracked_.PathOf(PartId(0));
  ASSERT_THAT(path, SizeIs(kFrames));
  for (const StampedPose& pose : path) EXPECT_LT(ErrorAt(pose), 0.02) << pose.timestamp_s;
  EXPECT_EQ(tracked_.LiveCountOf(PartId(0)), size_t{kFrames}) << "tracked then, and once more now";
  EXPECT_THAT(scene_.map.Validate(), IsEmpty());
}

TEST_F(LeapMenderTest, WhatWasOnlyGuessedBeyondALeapHasNoPoseAnyMore) {
  GoAstray(kFrames, kFrames);
  std::vector<AnchoredPose> guessed;
  for (int i = kFrames + 20; i < kFrames + 26; ++i)
    guessed.push_back({StampOf(i), keyframes_[0], SidewaysPose(9)});
  tracked_.AddFound(guessed);
  ASSERT_TRUE(tracked_.Leaps());
  EXPECT_EQ(mender_.CutOffSides({}), 1);
  EXPECT_FALSE(tracked_.Leaps());
  EXPECT_THAT(tracked_.PathOf(PartId(0)), SizeIs(kFrames));
}

// As long as some people take to pass.
TEST_F(LeapMenderTest, AStretchOfASecondIsFoundInTheRest) {
  GoAstray(50, 70);
  EXPECT_GT(mender_.MendEnds({}), 0);
  for (const StampedPose& pose : tracked_.PathOf(PartId(0)))
    EXPECT_LT(ErrorAt(pose), 0.02) << pose.timestamp_s;
}

TEST_F(LeapMenderTest, APathWithoutLeapsAndOneWhoseTrialIsInterruptedStayAsTheyAre) {
  GoAstray(kFrames, kFrames);
  EXPECT_EQ(mender_.MendEnds({}), 0);
  EXPECT_EQ(mender_.CutOffSides({}), 0);
  tracked_.Clear();
  kept_.Clear();
  GoAstray(50, 55);
  int asked = 0;
  EXPECT_EQ(mender_.MendEnds([&asked] { return ++asked > 1; }), 0);
  for (const StampedPose& pose : tracked_.PathOf(PartId(0))) {
    const bool is_astray = pose.timestamp_s >= StampOf(50) && pose.timestamp_s <= StampOf(55);
    EXPECT_NEAR(ErrorAt(pose), is_astray ? kAway : 0, 1e-5);
  }
}

TEST_F(LeapMenderTest, AFilmWithACutStaysWhole) {
  for (int i = 0; i < kFrames; ++i) {
    const double x = i < 50 ? 0.005 * i : 0.5 + 0.005 * i;
    Track(i, x, x);
  }
  ASSERT_TRUE(tracked_.Leaps());
  EXPECT_EQ(mender_.CutOffSides({}), 0);
  EXPECT_EQ(mender_.MendEnds({}), 0);
  EXPECT_THAT(tracked_.PathOf(PartId(0)), SizeIs(kFrames));
  EXPECT_THAT(tracked_.Parts(), SizeIs(1));
}

}  // namespace
}  // namespace dynamic_slam
