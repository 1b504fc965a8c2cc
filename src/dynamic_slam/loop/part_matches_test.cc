#include "dynamic_slam/loop/part_matches.h"

#include <algorithm>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/loop/two_visits.h"

namespace dynamic_slam {
namespace {

using testing::Each;
using testing::Field;
using testing::Ge;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

// Two parts, seen through the drift; of the points of the first so many look the same in the second.
TwoVisits TwoParts(size_t same_points) { return TwoVisits(kDrift, 0.05, true, same_points); }

PartMatches MatchesOf(const TwoVisits& visits) {
  return PartMatches(visits.world.camera(), visits.map.map, PartId(1), PartId(0));
}

TEST(PartMatchesTest, WhatLooksTheSameIsMatched) {
  const TwoVisits visits = TwoParts(TwoVisits::kPoints / 10);
  const PartMatches matches = MatchesOf(visits);
  ASSERT_THAT(matches.viewpoints(), Not(IsEmpty()));
  const PartMatches::Viewpoint& first = matches.viewpoints().front();
  EXPECT_EQ(visits.map.map.PartOf(first.here), PartId(1));
  EXPECT_EQ(visits.map.map.PartOf(first.there), PartId(0));
  const std::vector<Sim3Match> seen = matches.From(first);
  EXPECT_THAT(seen, SizeIs(Ge(20)));
  // Each is one point, which the two know through the drift.
  const Sim3 here_from_there = ToSim3(visits.map.map.keyframes().At(first.here).cam_from_world()) * kDrift *
                               ToSim3(visits.map.map.keyframes().At(first.there).cam_from_world()).Inverse();
  for (const Sim3Match& match : seen) {
    EXPECT_LT((here_from_there * match.x_in_second - match.x_in_first).norm(), 1e-6);
    EXPECT_LT((visits.world.camera().Project(match.x_in_first) - match.first_px).norm(), 1e-6);
  }
}

TEST(PartMatchesTest, TheViewpointsThatShowMostComeFirst) {
  const TwoVisits visits = TwoParts(TwoVisits::kPoints);
  const PartMatches matches = MatchesOf(visits);
  EXPECT_THAT(matches.viewpoints(), SizeIs(TwoVisits::kPasses * TwoVisits::kPasses));
  EXPECT_TRUE(std::is_sorted(matches.viewpoints().begin(), matches.viewpoints().end(),
                             [](const PartMatches::Viewpoint& a, const PartMatches::Viewpoint& b) {
                               return a.matches > b.matches;
                             }));
  EXPECT_THAT(matches.viewpoints(), Each(Field(&PartMatches::Viewpoint::matches, Ge(1))));
}

TEST(PartMatchesTest, WhatLooksDifferentIsNot) {
  const TwoVisits visits = TwoParts(0);
  EXPECT_THAT(MatchesOf(visits).viewpoints(), IsEmpty());
}

TEST(PartMatchesTest, APartThatIsNotThereHasNone) {
  const TwoVisits visits = TwoParts(TwoVisits::kPoints);
  EXPECT_THAT(PartMatches(visits.world.camera(), visits.map.map, PartId(1), PartId(7)).viewpoints(),
              IsEmpty());
}

TEST(JoinAlikeTest, PartsWithLittleInCommonAreJoined) {
  // A twelfth of the points looks the same: no two keyframes have enough of them to be a place.
  TwoVisits visits = TwoParts(TwoVisits::kPoints / 12);
  LoopCloser closer(visits.world.camera(), {}, 1, &visits.map.shared_map);
  for (const KeyframeId id : visits.ids[1]) EXPECT_FALSE(closer.Process(id, visits.map.map.epoch()).linked);
  const LoopResult result = closer.JoinAlike(PartId(1), PartId(0));
  ASSERT_TRUE(result.joined);
  EXPECT_NEAR(result.attempts.back().scale, kDrift.scale, 0.02);
  EXPECT_EQ(visits.map.map.Parts(), std::vector{PartId(0)});
  EXPECT_LT(visits.WorstCenter(), 0.03);
  EXPECT_THAT(visits.map.map.Validate(), IsEmpty());
}

TEST(JoinAlikeTest, TheOlderPartStaysWhicheverIsNamedFirst) {
  TwoVisits visits = TwoParts(TwoVisits::kPoints);
  LoopCloser closer(visits.world.camera(), {}, 1, &visits.map.shared_map);
  ASSERT_TRUE(closer.JoinAlike(PartId(0), PartId(1)).joined);
  EXPECT_EQ(visits.map.map.Parts(), std::vector{PartId(0)});
  EXPECT_LT(visits.WorstCenter(), 0.02);
}

TEST(JoinAlikeTest, TooFewThatFitOrAreFoundAreRefusedWithAReason) {
  for (const auto& [same_points, reason] :
       {std::pair(6, "fit one similarity < 10"), std::pair(18, "landmarks found < 25")}) {
    TwoVisits visits = TwoParts(same_points);
    LoopCloser closer(visits.world.camera(), {}, 1, &visits.map.shared_map);
    const LoopResult result = closer.JoinAlike(PartId(1), PartId(0));
    EXPECT_FALSE(result.joined);
    ASSERT_THAT(result.attempts, SizeIs(1));
    EXPECT_THAT(result.attempts[0].reason, testing::HasSubstr(reason));
    EXPECT_EQ(visits.map.map.Parts().size(), 2u);
  }
}

TEST(JoinAlikeTest, TwoPlacesAreNotJoined) {
  TwoVisits visits = TwoParts(0);
  LoopCloser closer(visits.world.camera(), {}, 1, &visits.map.shared_map);
  const LoopResult result = closer.JoinAlike(PartId(1), PartId(0));
  EXPECT_FALSE(result.joined);
  EXPECT_THAT(result.attempts, IsEmpty());
}

TEST(JoinAlikeTest, StoppedItLeavesTheMapAsItWas) {
  TwoVisits visits = TwoParts(TwoVisits::kPoints);
  const double before = visits.WorstCenter();
  LoopCloser closer(visits.world.camera(), {}, 1, &visits.map.shared_map);
  EXPECT_FALSE(closer.JoinAlike(PartId(1), PartId(0), [] { return true; }).joined);
  EXPECT_EQ(visits.WorstCenter(), before);
  EXPECT_EQ(visits.map.map.Parts().size(), 2u);
}

}  // namespace
}  // namespace dynamic_slam
