#include "dynamic_slam/loop/loop_closer.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/loop/two_visits.h"

namespace dynamic_slam {
namespace {

using testing::Each;
using testing::Field;
using testing::IsEmpty;
using testing::Not;

TEST(LoopCloserTest, FindsThePlaceAndTakesTheDriftAway) {
  TwoVisits visits(kDrift);
  const size_t landmarks = visits.map.map.landmarks().size();
  EXPECT_GT(visits.WorstCenter(), 0.2);
  const LoopResult result = visits.Close();
  ASSERT_TRUE(result.corrected);
  EXPECT_NEAR(result.attempts.back().scale, kDrift.scale, 0.02);
  EXPECT_LT(visits.WorstCenter(), 0.02);
  EXPECT_LT(visits.map.map.landmarks().size(), landmarks - 100);
  EXPECT_THAT(visits.map.map.Validate(), IsEmpty());
  EXPECT_FALSE(visits.map.map.keyframes().At(visits.ids[1].back()).covisible().empty());
}

TEST(LoopCloserTest, APlaceInAnotherPartOfTheMapJoinsThem) {
  TwoVisits visits(kDrift, 0.05, true);
  ASSERT_EQ(visits.map.map.Parts().size(), 2u);
  const std::vector<double> before = visits.DistancesOfSecondVisit();
  const LoopResult result = visits.Close();
  ASSERT_TRUE(result.joined);
  EXPECT_EQ(visits.map.map.Parts(), std::vector{PartId(0)});
  EXPECT_EQ(visits.map.map.PartOf(visits.ids[1].front()), PartId(0));
  EXPECT_LT(visits.WorstCenter(), 0.02);
  // Moved and scaled as a whole.
  const std::vector<double> after = visits.DistancesOfSecondVisit();
  for (size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(after[i] / before[i], after[0] / before[0], 1e-9);
  EXPECT_NEAR(visits.map.map.UnitOf(visits.ids[1].back()), 1 / kDrift.scale, 0.02);
  EXPECT_THAT(visits.map.map.Validate(), IsEmpty());
}

TEST(LoopCloserTest, PartsAreJoinedByASimilarityThatIsKnownFromElsewhere) {
  for (const std::string reason : {"", "nobody is sure of it"}) {
    TwoVisits visits(kDrift, 0.05, true);
    const Keyframe& keyframe = visits.map.map.keyframes().At(visits.ids[1].front());
    const Keyframe& candidate = visits.map.map.keyframes().At(visits.ids[0].back());
    const Sim3 similarity =
        ToSim3(keyframe.cam_from_world()) * kDrift * ToSim3(candidate.cam_from_world()).Inverse();
    LoopCloser closer(visits.world.camera(), {}, 1, &visits.map.shared_map);
    LoopAttempt attempt;
    attempt.reason = reason;
    const Loop loop{keyframe.id(), candidate.id(), similarity, {}, {}, true};
    const uint32_t epoch = visits.map.map.epoch();
    EXPECT_THAT(closer.Join(loop, attempt, epoch + 1).attempts, IsEmpty()) << "another map";
    const LoopResult result = closer.Join(loop, attempt, epoch);
    EXPECT_EQ(result.joined, reason.empty());
    EXPECT_EQ(visits.map.map.Parts().size(), reason.empty() ? 1u : 2u);
    ASSERT_EQ(result.attempts.size(), 1u);
    EXPECT_EQ(result.attempts[0].reason, reason);
    EXPECT_EQ(result.attempts[0].scale, similarity.scale);
    if (!reason.empty()) continue;
    EXPECT_LT(visits.WorstCenter(), 1e-6);
    EXPECT_GT(result.landmarks_merged, 100) << "what both saw is one";
    EXPECT_THAT(visits.map.map.Validate(), IsEmpty());
  }
}

TEST(LoopCloserTest, OtherPartsOfTheMapStayWhereTheyAre) {
  TwoVisits visits(kDrift);
  const PartId other = visits.map.map.BeginPart();
  const KeyframeId elsewhere = visits.map.Add(SidewaysPose(30), other);
  const Rigid3 before = visits.map.map.keyframes().At(elsewhere).cam_from_world();
  ASSERT_TRUE(visits.Close().corrected);
  EXPECT_EQ(visits.map.map.keyframes().At(elsewhere).cam_from_world(), before);
  EXPECT_EQ(visits.map.map.Parts().size(), 2u);
}

TEST(LoopCloserTest, FramesFollowTheirKeyframesAndTheirScale) {
  TwoVisits visits(kDrift);
  // In the drifted map lengths are 1.25 times what they should be.
  const Rigid3 cam_from_reference(Eigen::Quaterniond::Identity(), kDrift.scale * Eigen::Vector3d(0.1, 0, 0));
  ASSERT_TRUE(visits.Close().corrected);
  const Rigid3 pose = visits.map.map.PoseFromReference(visits.ids[1].back(), cam_from_reference);
  const Rigid3 truth = Rigid3(Eigen::Quaterniond::Identity(), {0.1, 0, 0}) * visits.truth.back();
  EXPECT_LT((pose.TargetOriginInSource() - truth.TargetOriginInSource()).norm(), 0.02);
  EXPECT_NEAR(visits.map.map.UnitOf(visits.ids[1].back()), 1 / kDrift.scale, 0.02);
  EXPECT_EQ(visits.map.map.UnitOf(visits.ids[0].front()), 1);
}

TEST(LoopCloserTest, WithoutDriftItLinksAndMovesNothing) {
  TwoVisits visits(Sim3{});
  const double before = visits.WorstCenter();
  const LoopResult result = visits.Close();
  EXPECT_TRUE(result.linked);
  EXPECT_FALSE(result.corrected);
  EXPECT_GT(result.landmarks_merged, 100);
  EXPECT_EQ(visits.WorstCenter(), before);
  EXPECT_THAT(visits.map.map.Validate(), IsEmpty());
}

TEST(LoopCloserTest, OtherPlacesAreRefusedWithAReason) {
  TwoVisits visits(Sim3{}, 8.0);
  const LoopResult result = visits.Close({.min_score_ratio = 0});
  EXPECT_FALSE(result.linked);
  EXPECT_THAT(result.attempts, Each(Field(&LoopAttempt::reason, Not(IsEmpty()))));
}

TEST(LoopCloserTest, APartThatLooksTheSameIsNoPlace) {
  // A tenth of what there is fits exactly, as the ground of two streets may.
  const auto close = [](double min_found_share) {
    return TwoVisits(kDrift, 0.05, false, TwoVisits::kPoints / 10)
        .Close({.min_score_ratio = 0, .min_found_share = min_found_share});
  };
  EXPECT_TRUE(close(0).corrected);
  const LoopResult result = close(LoopOptions().min_found_share);
  EXPECT_FALSE(result.linked);
  EXPECT_THAT(result.attempts,
              testing::Contains(Field(&LoopAttempt::reason, testing::HasSubstr("should be visible"))));
}

TEST(LoopCloserTest, WhatMoversHideIsNotMissed) {
  // Somebody hides two thirds of the view, and of the rest a third looks the same.
  TwoVisits visits(kDrift, 0.05, false, TwoVisits::kPoints / 3, 3 * TwoVisits::kPoints, 220);
  const LoopResult result = visits.Close({.min_score_ratio = 0});
  EXPECT_TRUE(result.corrected);
  EXPECT_LT(visits.WorstCenter(), 0.02);
}

TEST(LoopCloserTest, OlderKeyframesDoNotLookForYoungerOnes) {
  TwoVisits visits(kDrift);
  LoopCloser closer(visits.world.camera(), {}, 1, &visits.map.shared_map);
  EXPECT_THAT(closer.Process(visits.ids[0].back(), visits.map.map.epoch()).attempts, IsEmpty());
}

TEST(LoopCloserTest, PlacesThatLookLessAlikeThanNeighboursDoAreNotTried) {
  TwoVisits visits(kDrift);
  EXPECT_THAT(visits.Close({.min_score_ratio = 100}).attempts, IsEmpty());
}

TEST(LoopCloserTest, APlaceOfWhichMostIsKnownIsNoNews) {
  SyntheticWorld world(1500);
  SyntheticMap map(&world);
  std::vector<KeyframeId> visits[2], all;
  for (int i = 0; i < 12; ++i) {
    all.push_back(map.Add(SidewaysPose(0.1 * (i % 6) + (i < 6 ? 0 : 0.05))));
    visits[i / 6].push_back(all.back());
  }
  map.AddLandmarks(0, 900, all);
  for (const auto& visit : visits) map.AddLandmarks(900, 1500, visit);
  LoopCloser closer(world.camera(), {.min_score_ratio = 0, .covisible_weight = 100000}, 1, &map.shared_map);
  const size_t landmarks = map.map.landmarks().size();
  const LoopResult result = closer.Process(all.back(), map.map.epoch());
  EXPECT_FALSE(result.linked);
  EXPECT_THAT(result.attempts,
              testing::Contains(Field(&LoopAttempt::reason, testing::HasSubstr("known already"))));
  EXPECT_EQ(map.map.landmarks().size(), landmarks);
}

TEST(LoopCloserTest, AKeyframeThatCameMeanwhileMovesAlong) {
  TwoVisits visits(kDrift);
  const Rigid3 before = visits.map.map.keyframes().At(visits.ids[1].back()).cam_from_world();
  KeyframeId younger;
  const LoopResult result = visits.Close({}, [&] {
    if (younger.IsValid()) return false;
    younger = visits.map.Add(visits.truth.back());  // which shares no landmark yet
    visits.map.map.keyframes().At(younger).set_cam_from_world(before);
    return false;
  });
  ASSERT_TRUE(result.corrected);
  ASSERT_TRUE(younger.IsValid());
  const Keyframe& moved = visits.map.map.keyframes().At(younger);
  EXPECT_LT((moved.CenterInWorld() - visits.truth.back().TargetOriginInSource()).norm(), 0.02);
}

TEST(LoopCloserTest, OneKeyframeAloneIsNotBelieved) {
  TwoVisits visits(kDrift);
  const LoopResult result = visits.Close({.min_confirming_inliers = 1000});
  EXPECT_FALSE(result.linked);
  ASSERT_FALSE(result.attempts.empty());
  EXPECT_THAT(result.attempts[0].reason, testing::HasSubstr("0 of 5 neighbours"));
}

TEST(LoopCloserTest, StoppedItLeavesTheMapAsItWas) {
  TwoVisits visits(kDrift);
  const double before = visits.WorstCenter();
  const LoopResult result = visits.Close({}, [] { return true; });
  EXPECT_FALSE(result.linked);
  EXPECT_EQ(visits.WorstCenter(), before);
  EXPECT_THAT(result.attempts.back().reason, testing::HasSubstr("stopped"));
}

TEST(LoopCloserTest, AMapThatWasGivenUpIsLeftAlone) {
  TwoVisits visits(kDrift);
  LoopCloser closer(visits.world.camera(), {}, 1, &visits.map.shared_map);
  const uint32_t epoch = visits.map.map.epoch();
  visits.map.map.Reset();
  EXPECT_THAT(closer.Process(visits.ids[1].back(), epoch).attempts, IsEmpty());
}

TEST(LoopCloserTest, AfterACorrectionAFewKeyframesRest) {
  TwoVisits visits(kDrift);
  LoopCloser closer(visits.world.camera(), {.min_keyframes_between = 2}, 1, &visits.map.shared_map);
  const uint32_t epoch = visits.map.map.epoch();
  ASSERT_TRUE(closer.Process(visits.ids[1].back(), epoch).corrected);
  for (int i = 0; i < 2; ++i) EXPECT_THAT(closer.Process(visits.ids[1][0], epoch).attempts, IsEmpty());
}

TEST(LoopCloserTest, ThoseThatRestAreLookedAtWhereItIsAskedFor) {
  TwoVisits visits(kDrift, 0.05, true);
  LoopCloser closer(visits.world.camera(), {.min_keyframes_between = 2}, 1, &visits.map.shared_map);
  const uint32_t epoch = visits.map.map.epoch();
  const KeyframeId keyframe = visits.ids[1].back();
  ASSERT_TRUE(closer.Process(keyframe, epoch).joined);
  visits.map.map.SplitPart(visits.ids[1]);
  EXPECT_THAT(closer.Process(keyframe, epoch).attempts, IsEmpty());
  EXPECT_THAT(closer.ProcessNow(keyframe, epoch + 1).attempts, IsEmpty()) << "another map";
  EXPECT_THAT(closer.ProcessNow(keyframe, epoch).attempts, Not(IsEmpty()));
}

TEST(LoopCloserTest, TheSameMapGivesTheSameBits) {
  TwoVisits first(kDrift), second(kDrift);
  first.Close();
  second.Close();
  EXPECT_EQ(first.WorstCenter(), second.WorstCenter());
}

}  // namespace
}  // namespace dynamic_slam
