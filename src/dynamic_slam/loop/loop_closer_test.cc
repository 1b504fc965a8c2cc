#include "dynamic_slam/loop/loop_closer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {
namespace {

using testing::Each;
using testing::Field;
using testing::IsEmpty;
using testing::Not;

constexpr int kPoints = 1500;
constexpr int kPasses = 6;  // keyframes each time that the camera comes by

// The camera comes by twice and makes landmarks of its own each time, as if it did not know that it was here
// before.
struct TwoVisits {
  // The second visit begins at `x`, and is seen through the drift; in a part of the map of its own, or not.
  // Only some points look the same then.
  explicit TwoVisits(const Sim3& drift, double second_x = 0.05, bool starts_anew = false,
                     size_t same_points = kPoints)
      : world(kPoints), map(&world) {
    for (int visit = 0; visit < 2; ++visit) {
      if (visit == 1) world.Repaint(same_points);
      const PartId part = visit == 0 || starts_anew ? map.map.BeginPart() : PartId(0);
      for (int i = 0; i < kPasses; ++i) {
        const double x = 0.1 * i + (visit == 0 ? first_x : first_x + second_x);
        truth.push_back(SidewaysPose(x));
        ids[visit].push_back(map.Add(truth.back(), part));
      }
      map.AddLandmarks(0, static_cast<uint32_t>(world.size()), ids[visit]);
    }
    map.map.landmarks().ForEach([&](Landmark& landmark) {
      if (landmark.created_by() == ids[1].back()) landmark.Transform(drift);
    });
    for (const KeyframeId id : ids[1]) {
      Keyframe& keyframe = map.map.keyframes().At(id);
      keyframe.set_cam_from_world(ToRigid3(ToSim3(keyframe.cam_from_world()) * drift.Inverse()));
    }
  }

  LoopResult Close(const LoopOptions& options = {}, const std::function<bool()>& should_stop = {}) {
    LoopCloser closer(world.camera(), options, 1, &map.shared_map);
    return closer.Process(ids[1].back(), map.map.epoch(), should_stop);
  }

  double WorstCenter() const {
    double worst = 0;
    for (size_t i = 0; i < truth.size(); ++i) {
      const Keyframe& keyframe = map.map.keyframes().At(KeyframeId(static_cast<uint32_t>(i)));
      worst = std::max(worst, (keyframe.CenterInWorld() - truth[i].TargetOriginInSource()).norm());
    }
    return worst;
  }

  // From its first keyframe to the others, in lengths of the map.
  std::vector<double> DistancesOfSecondVisit() const {
    const auto center = [&](int i) { return map.map.keyframes().At(ids[1][i]).CenterInWorld(); };
    std::vector<double> distances;
    for (int i = 1; i < kPasses; ++i) distances.push_back((center(i) - center(0)).norm());
    return distances;
  }

  double first_x = 0;
  SyntheticWorld world;
  SyntheticMap map;
  std::vector<Rigid3> truth;
  std::vector<KeyframeId> ids[2];
};

const Sim3 kDrift{1.25, ExpSo3({0, 0.1, 0.02}), {0.3, 0.1, -0.2}};

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
    return TwoVisits(kDrift, 0.05, false, kPoints / 10)
        .Close({.min_score_ratio = 0, .min_found_share = min_found_share});
  };
  EXPECT_TRUE(close(0).corrected);
  const LoopResult result = close(LoopOptions().min_found_share);
  EXPECT_FALSE(result.linked);
  EXPECT_THAT(result.attempts,
              testing::Contains(Field(&LoopAttempt::reason, testing::HasSubstr("should be visible"))));
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

TEST(LoopCloserTest, TheSameMapGivesTheSameBits) {
  TwoVisits first(kDrift), second(kDrift);
  first.Close();
  second.Close();
  EXPECT_EQ(first.WorstCenter(), second.WorstCenter());
}

}  // namespace
}  // namespace dynamic_slam
