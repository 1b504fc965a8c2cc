#include "dynamic_slam/eval/metrics.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

PoseList AtTimes(const std::vector<double>& stamps) {
  PoseList poses;
  for (const double t : stamps) poses.push_back({t, Eigen::Matrix3d::Identity(), Eigen::Vector3d(t, 0, 0)});
  return poses;
}

std::vector<double> Stamps(const PoseList& poses) {
  std::vector<double> stamps;
  for (const EvalPose& pose : poses) stamps.push_back(pose.timestamp_s);
  return stamps;
}

// A curved path with turning camera.
PoseList Walk(int frames) {
  PoseList poses;
  for (int i = 0; i < frames; ++i) {
    const double s = 0.1 * i;
    poses.push_back({s, ExpSo3({0.1 * s, 0.3 * std::sin(s), 0.05}).toRotationMatrix(),
                     Eigen::Vector3d(s, std::sin(s), std::cos(2 * s))});
  }
  return poses;
}

PoseList Moved(const PoseList& poses, const Sim3& by) {
  PoseList moved = poses;
  for (EvalPose& pose : moved) {
    pose.position = by * pose.position;
    pose.rotation = by.rotation.toRotationMatrix() * pose.rotation;
  }
  return moved;
}

template <class Function>
std::string InputErrorOf(Function&& function) {
  try {
    function();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no InputError";
}

TEST(MatchByTime, TakesTheNearestForEachPoseOfTheShorterList) {
  const PoseList longer = AtTimes({0, 1, 2, 3, 4, 5}), shorter = AtTimes({1.3, 2.9, 9});
  const MatchedPoses estimate_shorter = MatchByTime(longer, shorter, 0.5);
  EXPECT_THAT(Stamps(estimate_shorter.reference), ElementsAre(1, 3));
  EXPECT_THAT(Stamps(estimate_shorter.estimate), ElementsAre(1.3, 2.9));
  const MatchedPoses reference_shorter = MatchByTime(shorter, longer, 0.5);
  EXPECT_THAT(Stamps(reference_shorter.reference), ElementsAre(1.3, 2.9));
  EXPECT_THAT(Stamps(reference_shorter.estimate), ElementsAre(1, 3));
}

TEST(MatchByTime, OfTwoEquallyNearTheEarlierAndMaxDtItselfIsAllowed) {
  const MatchedPoses matched = MatchByTime(AtTimes({0, 1, 2}), AtTimes({0.5}), 0.5);
  EXPECT_THAT(Stamps(matched.reference), ElementsAre(0));
}

TEST(MatchByTime, APoseOfTheLongerListMayServeTwice) {
  const MatchedPoses matched = MatchByTime(AtTimes({0, 1, 2}), AtTimes({0.9, 1.1}), 0.2);
  EXPECT_THAT(Stamps(matched.reference), ElementsAre(1, 1));
}

TEST(MatchByTime, SaysWhichTimesDoNotMeet) {
  EXPECT_THAT(InputErrorOf([] {
                MatchByTime(AtTimes({0, 1}), AtTimes({100, 101}), 0.01);
              }),
              HasSubstr("ground truth 0.000 to 1.000 s, estimate 100.000 to 101.000 s"));
  EXPECT_THAT(InputErrorOf([] { MatchByTime(AtTimes({0, 1}), {}, 0.01); }), HasSubstr("estimate empty"));
}

TEST(MatchByRow, NeedsEqualLengths) {
  EXPECT_THAT(InputErrorOf([] {
                MatchByRow(AtTimes({0, 1}), AtTimes({0}));
              }),
              HasSubstr("ground truth has 2 rows, estimate 1"));
}

TEST(AbsolutePoseError, AlignmentRemovesAnyTransformOfItsKind) {
  const PoseList truth = Walk(60);
  const Sim3 rigid{1.0, ExpSo3({1, -0.5, 0.3}), {3, 4, -5}};
  const Sim3 similar{0.4, rigid.rotation, rigid.translation};
  EXPECT_LT(AbsolutePoseError({truth, Moved(truth, rigid)}, Alignment::kSe3).translation_m.max, 1e-12);
  EXPECT_LT(AbsolutePoseError({truth, Moved(truth, rigid)}, Alignment::kSe3).rotation_deg.max, 1e-10);
  const TrajectoryErrors errors = AbsolutePoseError({truth, Moved(truth, similar)}, Alignment::kSim3);
  EXPECT_LT(errors.translation_m.max, 1e-12);
  EXPECT_NEAR(errors.reference_from_estimate.scale, 1 / 0.4, 1e-12);
  EXPECT_GT(AbsolutePoseError({truth, Moved(truth, similar)}, Alignment::kSe3).translation_m.rmse, 0.1);
  EXPECT_GT(AbsolutePoseError({truth, Moved(truth, rigid)}, Alignment::kNone).translation_m.rmse, 1);
}

TEST(AbsolutePoseError, WithoutAlignmentIsThePlainDifference) {
  const PoseList truth = Walk(10);
  const Sim3 shift{1.0, Eigen::Quaterniond::Identity(), {3, 0, 4}};
  const TrajectoryErrors shifted = AbsolutePoseError({truth, Moved(truth, shift)}, Alignment::kNone);
  EXPECT_NEAR(shifted.translation_m.min, 5, 1e-12);
  EXPECT_NEAR(shifted.translation_m.max, 5, 1e-12);
  EXPECT_LT(shifted.rotation_deg.max, 1e-12);
  PoseList turned = truth;
  for (EvalPose& pose : turned) {
    pose.rotation = pose.rotation * ExpSo3({0, std::numbers::pi / 6, 0}).toRotationMatrix();
  }
  EXPECT_NEAR(AbsolutePoseError({truth, turned}, Alignment::kNone).rotation_deg.mean, 30, 1e-10);
}

TEST(AbsolutePoseError, RefusesToAlignALine) {
  const PoseList line = AtTimes({0, 1, 2, 3});
  EXPECT_THAT(InputErrorOf([&] {
                AbsolutePoseError({line, line}, Alignment::kSim3);
              }),
              HasSubstr("on one line"));
  EXPECT_EQ(AbsolutePoseError({line, line}, Alignment::kNone).translation_m.n, 4u);
}

TEST(RelativePoseError, IsBlindToWhereTheWorldFrameIs) {
  Random random(5);
  const PoseList truth = Walk(40);
  PoseList estimate = truth;
  for (EvalPose& pose : estimate) pose.position.x() += 0.01 * random.Gaussian();
  const Sim3 rigid{1.0, ExpSo3({1, -0.5, 0.3}), {3, 4, -5}};
  const TrajectoryErrors here = RelativePoseError({truth, estimate}, Alignment::kNone, {});
  const TrajectoryErrors there = RelativePoseError({truth, Moved(estimate, rigid)}, Alignment::kNone, {});
  EXPECT_NEAR(here.translation_m.rmse, there.translation_m.rmse, 1e-12);
  EXPECT_NEAR(here.rotation_deg.rmse, there.rotation_deg.rmse, 1e-10);
}

TEST(RelativePoseError, PairsFollowOneAnother) {
  const PoseList line = AtTimes({0, 1, 2, 3, 4, 5, 6, 7, 8, 9});
  const auto pairs = [&line](double delta, DeltaUnit unit) {
    return RelativePoseError({line, line}, Alignment::kNone, {delta, unit}).translation_m.n;
  };
  EXPECT_EQ(pairs(1, DeltaUnit::kFrames), 9u);
  EXPECT_EQ(pairs(3, DeltaUnit::kFrames), 3u);  // 0-3, 3-6, 6-9
  EXPECT_EQ(pairs(4, DeltaUnit::kFrames), 2u);  // 0-4, 4-8
  EXPECT_EQ(pairs(3, DeltaUnit::kMetres), 2u);  // 3-6, 6-9
  EXPECT_EQ(pairs(2.5, DeltaUnit::kMetres), 2u);
}

TEST(RelativePoseError, MetresAreThoseOfTheEstimate) {
  const PoseList truth = AtTimes({0, 1, 2, 3, 4, 5, 6});
  PoseList half = truth;
  for (EvalPose& pose : half) pose.position *= 0.5;
  const TrajectoryErrors errors = RelativePoseError({truth, half}, Alignment::kNone, {1, DeltaUnit::kMetres});
  EXPECT_EQ(errors.translation_m.n, 2u);  // 2-4, 4-6
  EXPECT_NEAR(errors.translation_m.mean, 1, 1e-12);
}

TEST(RelativePoseError, RefusesADeltaThatGivesNoPair) {
  const PoseList line = AtTimes({0, 1, 2});
  const auto complaint = [&line](double delta, DeltaUnit unit) {
    return InputErrorOf([&] { RelativePoseError({line, line}, Alignment::kNone, {delta, unit}); });
  };
  EXPECT_THAT(complaint(3, DeltaUnit::kFrames),
              HasSubstr("no two of the 3 matched poses are 3 frames apart"));
  EXPECT_THAT(complaint(50, DeltaUnit::kMetres), HasSubstr("are 50 m apart"));
  EXPECT_THAT(complaint(1.5, DeltaUnit::kFrames), HasSubstr("not a whole number"));
  EXPECT_THAT(complaint(0, DeltaUnit::kFrames), HasSubstr("not a whole number"));
  EXPECT_THAT(complaint(-1, DeltaUnit::kMetres), HasSubstr("not positive"));
}

TEST(Summarise, DefinitionsByHand) {
  const ErrorStatistics s = Summarise({4, 1, 3, 2});
  EXPECT_EQ(s.n, 4u);
  EXPECT_DOUBLE_EQ(s.mean, 2.5);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.sse, 30);
  EXPECT_DOUBLE_EQ(s.rmse, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(s.std, std::sqrt(1.25));  // the population's
  EXPECT_DOUBLE_EQ(s.min, 1);
  EXPECT_DOUBLE_EQ(s.max, 4);
  EXPECT_DOUBLE_EQ(Summarise({5, 1, 2}).median, 2);
  EXPECT_EQ(Summarise({}).n, 0u);
}

}  // namespace
}  // namespace dynamic_slam
