#include "dynamic_slam/tracking/known_poses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;

// A camera that moves sideways, 1 unit and 20 frames a second, but for a gap from 1 to 2 s.
class KnownPosesTest : public testing::Test {
 protected:
  KnownPosesTest() {
    keyframe_ = scene_.Add(Rigid3());
    other_ = scene_.Add(Rigid3(), scene_.map.BeginPart());
    for (int i = 0; i <= 60; ++i) {
      const double t = 0.05 * i;
      if (t < 1.001 || t > 1.999) poses_.push_back({t, keyframe_, SidewaysPose(t)});
    }
  }
  KnownPoses Known() const { return KnownPoses(poses_, &scene_.shared_map); }
  static double XOf(const KnownPoses::Guess& guess) {
    return guess.cam_from_world.TargetOriginInSource().x();
  }

  SyntheticWorld world_{10};
  SyntheticMap scene_{&world_};
  KeyframeId keyframe_, other_;
  std::vector<AnchoredPose> poses_;
};

TEST_F(KnownPosesTest, GuessesBetweenPosesAndBeyondThem) {
  const KnownPoses known = Known();
  EXPECT_NEAR(known.interval_s(), 0.05, 1e-9);
  EXPECT_NEAR(XOf(known.Guesses(0.52).at(0)), 0.52, 1e-6);
  EXPECT_NEAR(XOf(known.Guesses(1.2).at(0)), 1.2, 1e-6) << "as it went on";
  EXPECT_NEAR(XOf(known.Guesses(1.2).at(1)), 1.0, 1e-6) << "or stopped";
  EXPECT_NEAR(XOf(known.Guesses(-0.1).at(0)), -0.1, 1e-6);
  EXPECT_THAT(known.Guesses(1.5), IsEmpty()) << "nobody knows";
  EXPECT_EQ(known.Guesses(0.5).at(0).keyframe, keyframe_);
}

TEST_F(KnownPosesTest, ThePosesAboutAStamp) {
  const KnownPoses known = Known();
  EXPECT_NEAR(known.Between(1.4).first, 1.0, 1e-9);
  EXPECT_NEAR(known.Between(1.4).second, 2.0, 1e-9);
  EXPECT_EQ(known.Nearest(1.5), nullptr);
  ASSERT_NE(known.Nearest(1.9), nullptr);
  EXPECT_NEAR(known.Nearest(1.9)->timestamp_s, 2.0, 1e-9);
  EXPECT_NEAR(known.Nearest(1.1)->timestamp_s, 1.0, 1e-9);
}

TEST_F(KnownPosesTest, NobodyIsMuchFasterThanTheCameraNearlyAlwaysWas) {
  const KnownPoses known = Known();
  EXPECT_TRUE(known.IsPlausible({1.1, keyframe_, SidewaysPose(1.15)}));
  EXPECT_FALSE(known.IsPlausible({1.1, keyframe_, SidewaysPose(1.35)}));
  EXPECT_TRUE(known.IsPlausible({1.1, other_, SidewaysPose(9)})) << "in another world";
  poses_.resize(10);
  EXPECT_TRUE(Known().IsPlausible({0.5, keyframe_, SidewaysPose(9)})) << "too few to tell";
}

TEST_F(KnownPosesTest, OfOnePartItStillKnowsHowOftenThereAreFrames) {
  poses_.push_back({1.5, other_, Rigid3()});
  const KnownPoses known = Known();
  const KnownPoses those = known.Within(scene_.map.PartOf(other_), 1, 2);
  EXPECT_EQ(those.by_stamp().size(), 1u);
  EXPECT_EQ(those.max_gap_s(), known.max_gap_s());
  EXPECT_EQ(those.Guesses(1.55).size(), 1u);
  EXPECT_FALSE(known.AreInOnePart(poses_[0], poses_.back()));
}

TEST_F(KnownPosesTest, WithOnePoseNothingIsKnownOfTheMotion) {
  poses_.resize(1);
  EXPECT_EQ(Known().max_gap_s(), 0);
  EXPECT_THAT(Known().Guesses(0.01), IsEmpty());
  EXPECT_THAT(KnownPoses({}, &scene_.shared_map).Guesses(0), IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
