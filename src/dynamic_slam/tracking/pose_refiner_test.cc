#include "dynamic_slam/tracking/pose_refiner.h"

#include <cmath>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

// A camera that moves sideways past a map, 1 unit a second, 20 frames a second.
class PoseRefinerTest : public testing::Test {
 protected:
  static constexpr int kMinInliers = 40, kFrames = 31;

  PoseRefinerTest() {
    for (const double x : {0.0, 0.5, 1.0}) keyframes_.push_back(scene_.Add(SidewaysPose(x)));
    scene_.AddLandmarks(0, static_cast<uint32_t>(world_.size()), keyframes_);
  }

  // Frame i at x = StampOf(i), known to be where the camera would be at known_x.
  void Keep(int i, double known_x, int min_inliers = kMinInliers) {
    Frame frame = world_.See(SidewaysPose(StampOf(i))).frame;
    frame.id = FrameId(static_cast<uint32_t>(i));
    frame.timestamp_s = StampOf(i);
    frame.cam_from_world = Rigid3();
    refiner_.Keep(frame, min_inliers);
    known_.push_back({StampOf(i), keyframes_[0], SidewaysPose(known_x)});
  }
  static double StampOf(int i) { return 0.05 * i; }
  double ErrorOf(const AnchoredPose& pose) const {
    const Rigid3 cam_from_world = scene_.map.PoseFromReference(pose.reference, pose.cam_from_reference);
    return (cam_from_world.TargetOriginInSource() - Eigen::Vector3d(pose.timestamp_s, 0, 0)).norm();
  }

  SyntheticWorld world_{600};
  SyntheticMap scene_{&world_};
  std::vector<KeyframeId> keyframes_;
  std::vector<AnchoredPose> known_;
  PoseRefiner refiner_{world_.camera(), TrackerOptions(), &scene_.shared_map};
};

TEST_F(PoseRefinerTest, PosesThatWereInexactAreExactInTheFinishedMap) {
  for (int i = 0; i < kFrames; ++i) Keep(i, StampOf(i) + (i % 2 == 0 ? 0.02 : -0.02));
  const std::vector<AnchoredPose> refined = refiner_.Refine(known_, {});
  ASSERT_THAT(refined, SizeIs(kFrames));
  for (int i = 0; i < kFrames; ++i) {
    EXPECT_EQ(refined[static_cast<size_t>(i)].timestamp_s, StampOf(i));
    EXPECT_LT(ErrorOf(refined[static_cast<size_t>(i)]), 0.005);
  }
}

TEST_F(PoseRefinerTest, WhatWentAstrayIsFoundFromTheFramesBefore) {
  for (int i = 0; i < kFrames; ++i) Keep(i, StampOf(i) + (i >= 20 && i < 25 ? 2 : 0));
  for (const AnchoredPose& pose : refiner_.Refine(known_, {}))
    EXPECT_LT(ErrorOf(pose), 0.005) << pose.timestamp_s;
}

TEST_F(PoseRefinerTest, WhatBeganAstrayIsFoundFromTheFramesAfter) {
  for (int i = 0; i < kFrames; ++i) Keep(i, StampOf(i) + (i < 5 ? 2 : 0));
  const std::vector<AnchoredPose> refined = refiner_.Refine(known_, {});
  EXPECT_THAT(refined, SizeIs(kFrames));
  for (const AnchoredPose& pose : refined) EXPECT_LT(ErrorOf(pose), 0.005) << pose.timestamp_s;
}

TEST_F(PoseRefinerTest, AFrameWithoutAPoseOrWithTooFewInliersGetsNone) {
  for (int i = 0; i < kFrames; ++i) Keep(i, StampOf(i), i == 10 ? 10000 : kMinInliers);
  known_.erase(known_.begin() + 20);
  const std::vector<AnchoredPose> refined = refiner_.Refine(known_, {});
  EXPECT_THAT(refined, SizeIs(kFrames - 2));
  for (const AnchoredPose& pose : refined) {
    EXPECT_NE(pose.timestamp_s, StampOf(10));
    EXPECT_NE(pose.timestamp_s, StampOf(20));
  }
}

TEST_F(PoseRefinerTest, WhatTheMapDoesNotConfirmIsRefutedWhereTheCameraCannotHaveBeen) {
  const std::set<int> unconfirmed{4, 9, 10, 11, 15, 16, 17}, away{9, 10, 15};
  for (int i = 0; i < kFrames; ++i) {
    const double known_x = StampOf(i) + (away.contains(i) ? 3 : 0);
    Keep(i, known_x, unconfirmed.contains(i) ? 10000 : kMinInliers);
  }
  known_.push_back({StampOf(4 * kFrames), keyframes_[0], SidewaysPose(99)});  // was not kept
  const std::vector<AnchoredPose> found = refiner_.Refine(known_, {});
  EXPECT_THAT(found, SizeIs(kFrames - 7));
  EXPECT_THAT(refiner_.Refuted(known_, found), ElementsAre(StampOf(9), StampOf(10), StampOf(11)))
      << "most of the row is where the camera cannot be";
  EXPECT_THAT(refiner_.Refuted(known_, {}), IsEmpty()) << "nobody knows";
}

TEST_F(PoseRefinerTest, KeypointsOfMoversAreNotLookedAt) {
  Frame frame = world_.See(SidewaysPose(0.5)).frame;
  frame.timestamp_s = 0.5;
  frame.static_probability.assign(frame.features.size(), 0.1f);
  refiner_.Keep(frame, 4);
  known_ = {{0.5, keyframes_[0], SidewaysPose(0.5)}};
  EXPECT_THAT(refiner_.Refine(known_, {}), IsEmpty());
}

TEST_F(PoseRefinerTest, ViewsAreWhatEveryThirdFrameBetweenKeyframesSeesOfTheMap) {
  for (int i = 0; i < kFrames; ++i) Keep(i, StampOf(i));
  {
    const auto map = scene_.shared_map.Write();
    for (const int i : {9, 12, 14}) {
      Frame frame = world_.See(SidewaysPose(StampOf(i))).frame;
      frame.timestamp_s = StampOf(i);
      InsertKeyframe(frame, map.get());
    }
  }
  std::vector<FrameView> views;
  refiner_.Refine(known_, {}, &views);
  std::vector<int> numbers;
  for (const FrameView& view : views)
    numbers.push_back(static_cast<int>(std::lround(view.timestamp_s / 0.05)));
  EXPECT_THAT(numbers, ElementsAre(3, 6, 17, 23, 26, 29)) << "keyframes at 0, 9, 12, 14 and 20";
  for (const FrameView& view : views) {
    const double centre = view.cam_from_world.TargetOriginInSource().x();
    EXPECT_NEAR(centre, view.timestamp_s, 0.005);
    EXPECT_EQ(view.part, PartId(0));
    EXPECT_GE(view.sightings.size(), static_cast<size_t>(kMinInliers));
    for (const FrameView::Sighting& sighting : view.sightings) {
      const Landmark& landmark = scene_.map.landmarks().At(sighting.landmark);
      const Eigen::Vector2d at = world_.camera().Project(view.cam_from_world * landmark.position());
      const double scale = SyntheticWorld::OctaveScales()[static_cast<size_t>(sighting.octave)];
      EXPECT_LT((at - sighting.ideal_px.cast<double>()).norm(), 2.5 * scale) << "inliers: 95% of what fits";
    }
  }
}

TEST_F(PoseRefinerTest, WhoAsksForAllViewsGetsOneOfEachPose) {
  for (int i = 0; i < kFrames; ++i) Keep(i, StampOf(i));
  std::vector<FrameView> views;
  const std::vector<AnchoredPose> refined = refiner_.Refine(known_, {}, &views, PoseRefiner::ViewsOf::kAll);
  ASSERT_EQ(views.size(), refined.size());
  for (size_t i = 0; i < views.size(); ++i) {
    EXPECT_EQ(views[i].timestamp_s, refined[i].timestamp_s);
    EXPECT_GE(views[i].sightings.size(), static_cast<size_t>(kMinInliers));
  }
}

TEST_F(PoseRefinerTest, GivesFramesAwayAsIfTheyHadNoPose) {
  for (int i = 0; i < kFrames; ++i) Keep(i, StampOf(i));
  Backfiller backfiller(world_.camera(), TrackerOptions(), 1, &scene_.shared_map);
  refiner_.GiveTo(&backfiller, {StampOf(10), StampOf(11)});
  std::erase_if(known_, [](const AnchoredPose& pose) {
    return pose.timestamp_s == StampOf(10) || pose.timestamp_s == StampOf(11);
  });
  const std::vector<AnchoredPose> found = backfiller.Find(known_, {});
  ASSERT_THAT(found, SizeIs(2));
  for (const AnchoredPose& pose : found) EXPECT_LT(ErrorOf(pose), 0.005);
}

TEST_F(PoseRefinerTest, StopsWhenItIsToldAndForgetsWhenCleared) {
  for (int i = 0; i < kFrames; ++i) Keep(i, StampOf(i));
  int asked = 0;
  EXPECT_THAT(refiner_.Refine(known_, [&asked] { return ++asked > 3; }), SizeIs(3));
  refiner_.Clear();
  EXPECT_THAT(refiner_.Refine(known_, {}), IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
