#include "dynamic_slam/tracking/backfiller.h"

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

// A camera that moves sideways past a map, 1 unit a second.
class BackfillerTest : public testing::Test {
 protected:
  static constexpr int kMinInliers = 40;

  BackfillerTest() {
    for (const double x : {0.0, 0.5, 1.0}) keyframes_.push_back(scene_.Add(SidewaysPose(x)));
    scene_.AddLandmarks(0, static_cast<uint32_t>(world_.size()), keyframes_);
    // 20 frames a second, but for a gap about 0.5 s.
    for (int i = 0; i <= 30; ++i) {
      const double t = 0.05 * i;
      if (std::abs(t - 0.5) < 0.12) continue;
      known_.push_back({t, keyframes_[0], SidewaysPose(t)});
    }
  }

  // At x = t, unless it is told.
  Frame FrameAt(double timestamp_s, std::optional<Rigid3> cam_from_world = {}) {
    Frame frame = world_.See(cam_from_world.value_or(SidewaysPose(timestamp_s))).frame;
    frame.timestamp_s = timestamp_s;
    frame.cam_from_world = Rigid3();
    return frame;
  }
  Eigen::Vector3d CentreOf(const AnchoredPose& pose) const {
    return scene_.map.PoseFromReference(pose.reference, pose.cam_from_reference).TargetOriginInSource();
  }

  SyntheticWorld world_{600};
  SyntheticMap scene_{&world_};
  std::vector<KeyframeId> keyframes_;
  std::vector<AnchoredPose> known_;
  Backfiller backfiller_{world_.camera(), TrackerOptions(), 1, &scene_.shared_map};
};

TEST_F(BackfillerTest, FramesBeforeBetweenAndAfterKnownPosesGetOne) {
  for (const double t : {-0.1, -0.05, 0.4, 0.45, 0.5, 0.6, 1.55})
    backfiller_.Keep(FrameAt(t), kMinInliers, false);
  const std::vector<AnchoredPose> found = backfiller_.Find(known_, {});
  EXPECT_EQ(found.size(), 7u);
  for (const AnchoredPose& pose : found) {
    EXPECT_LT((CentreOf(pose) - Eigen::Vector3d(pose.timestamp_s, 0, 0)).norm(), 0.02) << pose.timestamp_s;
  }
}

TEST_F(BackfillerTest, WhatLooksLikeNothingInTheMapHasNoPose) {
  world_.Repaint(0);
  backfiller_.Keep(FrameAt(0.5), kMinInliers, false);
  EXPECT_THAT(backfiller_.Find(known_, {}), IsEmpty());
}

TEST_F(BackfillerTest, APoseNeedsTheInliersThatItNeededThen) {
  backfiller_.Keep(FrameAt(0.5), 10000, false);
  EXPECT_THAT(backfiller_.Find(known_, {}), IsEmpty());
}

TEST_F(BackfillerTest, FarFromAnyPoseTwoFramesInARowAreFoundByWhatTheyLookLike) {
  for (const double t : {100.0, 100.05})
    backfiller_.Keep(FrameAt(t, SidewaysPose(t - 99.5)), kMinInliers, false);
  const std::vector<AnchoredPose> found = backfiller_.Find(known_, {});
  ASSERT_EQ(found.size(), 2u);
  for (const AnchoredPose& pose : found) {
    EXPECT_LT((CentreOf(pose) - Eigen::Vector3d(pose.timestamp_s - 99.5, 0, 0)).norm(), 0.02);
  }
}

TEST_F(BackfillerTest, APartThatIsIgnoredIsAsIfItWereNotThere) {
  backfiller_.Keep(FrameAt(0.5), kMinInliers, false);
  world_.Repaint(0);
  const PartId other = scene_.map.BeginPart();
  std::vector<KeyframeId> there;
  for (const double x : {0.0, 0.5, 1.0}) there.push_back(scene_.Add(SidewaysPose(x), other));
  scene_.AddLandmarks(0, static_cast<uint32_t>(world_.size()), there);
  for (const double t : {100.0, 100.05})
    backfiller_.Keep(FrameAt(t, SidewaysPose(t - 99.5)), kMinInliers, false);
  backfiller_.Ignore(other);
  EXPECT_EQ(backfiller_.Find(known_, {}).size(), 1u) << "in the part where poses are known";
  backfiller_.Ignore({});
  EXPECT_EQ(backfiller_.Find(known_, {}).size(), 3u);
}

TEST_F(BackfillerTest, FarFromAnyPoseWhatNoFrameBesideItConfirmsIsNoPose) {
  backfiller_.Keep(FrameAt(100, SidewaysPose(0.5)), kMinInliers, false);  // alone
  backfiller_.Keep(FrameAt(200, SidewaysPose(0.0)), kMinInliers, false);  // 20 units a second
  backfiller_.Keep(FrameAt(200.05, SidewaysPose(1.0)), kMinInliers, false);
  backfiller_.Keep(FrameAt(300, SidewaysPose(0.5)), kMinInliers, false);  // a gap between
  backfiller_.Keep(FrameAt(300.15, SidewaysPose(0.6)), kMinInliers, false);
  EXPECT_THAT(backfiller_.Find(known_, {}), IsEmpty());
}

TEST_F(BackfillerTest, OfTwoPlacesThatContradictEachOtherOneIsBelieved) {
  for (const auto& [t, x] : {std::pair(100.0, 0.0), {100.05, 0.05}, {100.1, 1.0}, {100.15, 1.05}})
    backfiller_.Keep(FrameAt(t, SidewaysPose(x)), kMinInliers, false);
  const std::vector<AnchoredPose> found = backfiller_.Find(known_, {});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].timestamp_s, 100.0);
  EXPECT_EQ(found[1].timestamp_s, 100.05);
}

TEST_F(BackfillerTest, WhatWasRecognisedBeforeItIsStoppedStays) {
  for (const double t : {100.0, 100.05, 100.1})
    backfiller_.Keep(FrameAt(t, SidewaysPose(t - 99.5)), kMinInliers, false);
  // Three neighbours are asked for each way, then the looks of the first two.
  int asked = 0;
  const std::vector<AnchoredPose> found = backfiller_.Find(known_, [&asked] { return ++asked >= 9; });
  EXPECT_EQ(found.size(), 2u) << asked;
}

TEST_F(BackfillerTest, MatchesThatLieAnywhereWithinTheLimitAreNoPose) {
  const double limit_px = std::sqrt(TrackerOptions().pose.chi2);
  for (const double share : {0.0, 1.0}) {
    Frame frame = FrameAt(0.5 + 0.05 * share);
    Random random(1);
    for (Keypoint& keypoint : frame.features.keypoints) {
      const double scale = world_.OctaveScales()[static_cast<size_t>(keypoint.octave)];
      const double r_px = share * scale * limit_px * std::sqrt(random.Uniform(0, 1));
      const double angle_rad = random.Uniform(-M_PI, M_PI);
      keypoint.x += static_cast<float>(r_px * std::cos(angle_rad));
      keypoint.y += static_cast<float>(r_px * std::sin(angle_rad));
    }
    frame.grid.Build(frame.features, world_.camera().IdealBounds());
    backfiller_.Keep(frame, 3 * kMinInliers, false);  // a few always seem to fit
  }
  const std::vector<AnchoredPose> found = backfiller_.Find(known_, {});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].timestamp_s, 0.5);
}

// The camera comes from where the map has nothing.
class GrowingBackfillerTest : public BackfillerTest {
 protected:
  static constexpr int kFrames = 60;

  GrowingBackfillerTest() {
    std::vector<LandmarkId> unknown;
    scene_.map.landmarks().ForEach([&](const Landmark& landmark) {
      if (landmark.position().x() < 0.5) unknown.push_back(landmark.id());
    });
    for (const LandmarkId id : unknown) scene_.map.EraseLandmark(id);
    for (int i = kFrames; i > 0; --i) backfiller_.Keep(FrameAt(-0.05 * i), kMinInliers, false);
  }

  // Landmarks of what the keyframe and the one before it show.
  void Map(KeyframeId id) {
    scene_.views.push_back(world_.See(SidewaysPose(scene_.map.keyframes().At(id).timestamp_s())));
    for (uint32_t point = 0; point < world_.size(); ++point) {
      std::vector<KeyframeId> free;
      for (const KeyframeId keyframe : {keyframes_.back(), id}) {
        const std::vector<uint32_t>& points = scene_.views[keyframe.value()].points;
        const auto found = std::find(points.begin(), points.end(), point);
        if (found == points.end()) continue;
        const auto keypoint = static_cast<size_t>(found - points.begin());
        if (!scene_.map.keyframes().At(keyframe).landmarks()[keypoint].IsValid()) free.push_back(keyframe);
      }
      if (free.size() == 2) scene_.AddLandmark(point, free);
    }
    keyframes_.push_back(id);
  }
};

TEST_F(GrowingBackfillerTest, TheMapGrowsAgainstTheOrderOfTime) {
  keyframes_ = {keyframes_[0]};
  const size_t without = backfiller_.Find(known_, {}).size();
  ASSERT_TRUE(backfiller_.PlanGrowth(known_, {}));
  const std::vector<AnchoredPose> found = backfiller_.Grow(known_, [this](KeyframeId id) { Map(id); }, {});
  EXPECT_LT(without, size_t{kFrames - 10});
  EXPECT_EQ(found.size(), size_t{kFrames});
  for (const AnchoredPose& pose : found) {
    EXPECT_LT((CentreOf(pose) - Eigen::Vector3d(pose.timestamp_s, 0, 0)).norm(), 0.05) << pose.timestamp_s;
  }
  EXPECT_GT(keyframes_.size(), 3u);
  EXPECT_LT(keyframes_.size(), 30u) << "not every frame";
  EXPECT_THAT(scene_.map.Validate(), IsEmpty());
}

TEST_F(BackfillerTest, WhatTheMapHasDoesNotGrowIt) {
  for (const double t : {0.4, 0.45, 0.5, 0.55, 0.6}) backfiller_.Keep(FrameAt(t), kMinInliers, false);
  int mapped = 0;
  EXPECT_FALSE(backfiller_.PlanGrowth(known_, {}));
  EXPECT_THAT(backfiller_.Grow(known_, [&mapped](KeyframeId) { ++mapped; }, {}), IsEmpty());
  EXPECT_EQ(mapped, 0);
  EXPECT_EQ(scene_.map.keyframes().size(), 3u);
  EXPECT_EQ(backfiller_.Find(known_, {}).size(), 5u) << "they are still looked for";
}

TEST_F(BackfillerTest, NobodyIsFasterThanTheCameraEverWas) {
  backfiller_.Keep(FrameAt(0.5, SidewaysPose(1.0)), kMinInliers, false);
  EXPECT_THAT(backfiller_.Find(known_, {}), IsEmpty());
}

TEST_F(BackfillerTest, FramesOfAnErasedPartAreFoundAndOthersAreNotLookedFor) {
  backfiller_.Keep(FrameAt(0.4), kMinInliers, true);
  backfiller_.PartWasErased();
  backfiller_.Keep(FrameAt(0.6), kMinInliers, true);
  backfiller_.ForgetPosed();
  const std::vector<AnchoredPose> found = backfiller_.Find(known_, {});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].timestamp_s, 0.4);
}

TEST_F(BackfillerTest, FramesThatAreNotToBeKeptAreNotLookedFor) {
  for (const double t : {0.4, 0.45, 0.5}) backfiller_.Keep(FrameAt(t), kMinInliers, false);
  EXPECT_THAT(backfiller_.Stamps(), ElementsAre(0.4, 0.45, 0.5));
  backfiller_.KeepOnly({0.4, 0.5, 0.7});
  EXPECT_THAT(backfiller_.Stamps(), ElementsAre(0.4, 0.5));
  EXPECT_EQ(backfiller_.Find(known_, {}).size(), 2u);
}

TEST_F(BackfillerTest, OnlyTheLastPosesAreWithdrawn) {
  for (const double t : {0.3, 0.4, 0.5}) backfiller_.Keep(FrameAt(t), kMinInliers, true);
  backfiller_.Keep(FrameAt(0.6), kMinInliers, false);
  backfiller_.LastWereWithdrawn(2);
  backfiller_.ForgetPosed();
  std::vector<double> stamps;
  for (const AnchoredPose& pose : backfiller_.Find(known_, {})) stamps.push_back(pose.timestamp_s);
  EXPECT_THAT(stamps, UnorderedElementsAre(0.4, 0.5, 0.6));
}

TEST_F(BackfillerTest, StopsWhenItIsTold) {
  for (const double t : {0.4, 0.5, 0.6}) backfiller_.Keep(FrameAt(t), kMinInliers, false);
  int asked = 0;
  EXPECT_EQ(backfiller_.Find(known_, [&asked] { return ++asked == 3; }).size(), 2u);
}

}  // namespace
}  // namespace dynamic_slam
