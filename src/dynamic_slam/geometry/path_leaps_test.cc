#include "dynamic_slam/geometry/path_leaps.h"

#include <cmath>

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

// A camera that goes to and fro, 30 frames a second, at up to a metre a second.
Trajectory Swing(size_t poses, double metre = 1) {
  Trajectory path;
  for (size_t i = 0; i < poses; ++i) {
    const double t = static_cast<double>(i) / 30;
    path.push_back({t, Rigid3(Eigen::Quaterniond::Identity(), {metre * std::sin(t), 0, metre * 0.1 * t})});
  }
  return path;
}

void Move(size_t from, double by_m, Trajectory* path) {
  for (size_t i = from; i < path->size(); ++i) (*path)[i].world_from_cam.translation.y() += by_m;
}

TEST(FindLeaps, APathWithoutOneHasNone) { EXPECT_TRUE(FindLeaps(Swing(300)).empty()); }

TEST(FindLeaps, FindsWhereTheRestOfThePathIsMoved) {
  for (const double metre : {0.01, 1.0, 100.0}) {
    Trajectory path = Swing(300, metre);
    Move(120, 0.2 * metre, &path);
    const std::vector<PathLeap> leaps = FindLeaps(path);
    ASSERT_EQ(leaps.size(), 1u) << metre;
    EXPECT_EQ(leaps[0].first, 119u);
    EXPECT_EQ(leaps[0].last, 120u);
    // 6 m/s instead of at most twice the 1 m/s of most of the time.
    EXPECT_NEAR(leaps[0].times_too_fast, 3, 0.1);
  }
}

TEST(FindLeaps, AStepIsNoLeapWhereThereWasTimeForIt) {
  Trajectory path = Swing(300);
  Move(120, 1.2, &path);
  path.erase(path.begin() + 100, path.begin() + 140);  // 1.3 s
  EXPECT_TRUE(FindLeaps(path).empty());
  path = Swing(300);
  Move(120, 5, &path);
  path.erase(path.begin() + 100, path.begin() + 140);
  const std::vector<PathLeap> leaps = FindLeaps(path);
  ASSERT_EQ(leaps.size(), 1u);
  EXPECT_EQ(leaps[0].first, 99u);
}

TEST(FindLeaps, WhatLeapsInSeveralStepsIsOne) {
  Trajectory path = Swing(300);
  for (const size_t from : {120, 121, 123}) Move(from, 0.2, &path);
  Move(200, 0.2, &path);
  const std::vector<PathLeap> leaps = FindLeaps(path);
  ASSERT_EQ(leaps.size(), 2u);
  EXPECT_EQ(leaps[0].first, 119u);
  EXPECT_EQ(leaps[0].last, 123u);
  EXPECT_EQ(leaps[1].first, 199u);
}

TEST(FindLeaps, ACameraThatGoesOffAtLastDoesNotLeap) {
  Trajectory path = Swing(300, 1e-3);
  for (size_t i = 290; i < 300; ++i) Move(i, 0.02, &path);
  ASSERT_EQ(FindLeaps(path).size(), 1u) << "ten steps can be one";
  Move(289, 0.02, &path);
  EXPECT_TRUE(FindLeaps(path).empty());
  Trajectory still(300, StampedPose{});
  for (size_t i = 0; i < still.size(); ++i) still[i].timestamp_s = static_cast<double>(i) / 30;
  Move(150, 1, &still);
  EXPECT_TRUE(FindLeaps(still).empty()) << "nobody knows how fast it can be";
}

TEST(FindLeaps, OfAFewPosesNobodyCanTell) {
  Trajectory path = Swing(20);
  Move(10, 50, &path);
  EXPECT_TRUE(FindLeaps(path).empty());
  EXPECT_TRUE(FindLeaps({}).empty());
  EXPECT_TRUE(FindLeaps(Swing(1)).empty());
}

TEST(CutAt, GivesTheNumberOfThePieceWithTheMostFirst) {
  Trajectory path = Swing(300);
  Move(120, 0.5, &path);
  const std::vector<size_t> pieces = CutAt(FindLeaps(path), path);
  ASSERT_EQ(pieces.size(), path.size());
  for (size_t i = 0; i < pieces.size(); ++i) EXPECT_EQ(pieces[i], i < 120 ? 1u : 0u) << i;
}

TEST(CutAt, CutsALeapOfSeveralStepsOnce) {
  Trajectory path = Swing(300);
  for (const size_t from : {120, 121, 122}) Move(from, from == 121 ? 0.5 : 0.2, &path);
  const std::vector<size_t> pieces = CutAt(FindLeaps(path), path);
  for (size_t i = 0; i < pieces.size(); ++i) EXPECT_EQ(pieces[i], i < 121 ? 1u : 0u) << i;
}

TEST(CutAt, TheMainPieceGoesOnAfterAnother) {
  Trajectory path = Swing(300);
  Move(100, 0.5, &path);
  Move(110, -0.5, &path);  // back
  Move(200, 10, &path);
  Move(210, 10, &path);  // farther away
  const std::vector<size_t> pieces = CutAt(FindLeaps(path), path);
  for (size_t i = 0; i < pieces.size(); ++i) {
    const size_t expected = i < 100 ? 0 : i < 110 ? 1 : i < 200 ? 0 : i < 210 ? 2 : 3;
    EXPECT_EQ(pieces[i], expected) << i;
  }
}

TEST(CutAt, BothEndsOfTheMainPieceStandForThemselves) {
  Trajectory path = Swing(600);
  Move(50, 1, &path);
  Move(550, 1, &path);
  const std::vector<size_t> pieces = CutAt(FindLeaps(path), path);
  EXPECT_EQ(pieces[0], 1u);
  EXPECT_EQ(pieces[300], 0u);
  EXPECT_EQ(pieces[599], 2u);
}

TEST(CutAt, APathWithoutLeapsIsOnePiece) {
  const Trajectory path = Swing(30);
  EXPECT_EQ(CutAt({}, path), std::vector<size_t>(30, 0));
  EXPECT_TRUE(CutAt({}, {}).empty());
}

TEST(LongestStep, IsThatOfTheMostSpeed) {
  EXPECT_NEAR(LongestStep(Swing(300)).value(), 2.0 / 30, 0.01);
  EXPECT_FALSE(LongestStep(Swing(20)).has_value());
  EXPECT_FALSE(LongestStep({}).has_value());
}

TEST(MostSpeed, IsTwiceWhatItNearlyAlwaysWas) {
  std::vector<double> speeds(100, 1.0);
  speeds[3] = speeds[70] = 40;
  EXPECT_DOUBLE_EQ(MostSpeed(&speeds).value(), 2);
  speeds.resize(19);
  EXPECT_FALSE(MostSpeed(&speeds).has_value());
}

}  // namespace
}  // namespace dynamic_slam
