#include "dynamic_slam/semantics/box_filter.h"

#include <cmath>

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

const Box kBox{100, 100, 100, 200};

TEST(BoxFilter, BeginsAtTheDetection) {
  const BoxFilter filter({}, kBox);
  EXPECT_NEAR(filter.box().x, 100, 1e-9);
  EXPECT_NEAR(filter.box().height, 200, 1e-9);
  EXPECT_EQ(filter.velocity_px_s().norm(), 0);
}

TEST(BoxFilter, LearnsAConstantVelocityAndKeepsItForAMoment) {
  BoxFilterOptions options;
  options.velocity_memory_s = 100;
  BoxFilter filter(options, kBox);
  Box box = kBox;
  for (int i = 0; i < 60; ++i) {
    box.x += 4;
    filter.Predict(options, 1 / 30.0);
    filter.Update(options, box);
  }
  EXPECT_NEAR(filter.velocity_px_s().x(), 120, 2);
  for (int i = 0; i < 15; ++i) filter.Predict(options, 1 / 30.0);
  EXPECT_NEAR(filter.box().x, box.x + 60, 2);
}

TEST(BoxFilter, ForgetsTheVelocityOfWhatItDoesNotSee) {
  BoxFilterOptions options;
  BoxFilter filter(options, kBox);
  filter.Follow(options, 1 / 30.0, {10, 0}, 1, {0, 0});
  const double speed = filter.velocity_px_s().x();
  EXPECT_GT(speed, 0);
  filter.Predict(options, options.velocity_memory_s);
  EXPECT_NEAR(filter.velocity_px_s().x(), speed / std::exp(1), 1e-9);
}

TEST(BoxFilter, OneStepIsAsGoodAsTwo) {
  // Without noise the prediction does not depend on how the time is cut.
  BoxFilterOptions options;
  options.velocity_noise = options.extent_rate_noise = 0;
  BoxFilter once(options, kBox);
  once.Follow(options, 0.1, {20, -10}, 1.05, {0, 0});
  BoxFilter twice = once;
  once.Predict(options, 0.5);
  twice.Predict(options, 0.2);
  twice.Predict(options, 0.3);
  EXPECT_NEAR(once.box().x, twice.box().x, 1e-9);
  EXPECT_NEAR(once.box().height, twice.box().height, 1e-9);
  const Box far{300, 100, 100, 200};
  EXPECT_NEAR(once.SquaredDistance(options, far), twice.SquaredDistance(options, far), 1e-9);
}

TEST(BoxFilter, FollowsAShiftAndAScale) {
  BoxFilter filter({}, kBox);
  filter.Follow({}, 1 / 30.0, {7, -3}, 1.1, {0, 0});
  EXPECT_NEAR(filter.box().CenterX(), 157, 1e-9);
  EXPECT_NEAR(filter.box().CenterY(), 197, 1e-9);
  EXPECT_NEAR(filter.box().width, 110, 1e-9);
}

TEST(BoxFilter, ADistanceShrinksAsTheUncertaintyGrows) {
  BoxFilter filter({}, kBox);
  const Box beside{130, 100, 100, 200};
  const double before = filter.SquaredDistance({}, beside);
  // At first: 30 px in sigmas of twice the variance of 5% of sqrt(100 * 200) px.
  EXPECT_NEAR(before, 900 / (2 * 0.05 * 0.05 * 20'000), 1e-9);
  filter.Predict({}, 0.5);
  EXPECT_LT(filter.SquaredDistance({}, beside), before);
}

TEST(BoxFilter, ATurnOfTheImageTurnsTheVelocity) {
  BoxFilter filter({}, kBox);
  filter.Follow({}, 1 / 30.0, {10, 0}, 1, {0, 0});
  const double speed = filter.velocity_px_s().x();
  Eigen::Matrix2d quarter;
  quarter << 0, -1, 1, 0;
  filter.Move({5, 6}, quarter);
  EXPECT_NEAR(filter.velocity_px_s().y(), speed, 1e-9);
  EXPECT_NEAR(filter.box().CenterX(), 165, 1e-9);
  EXPECT_NEAR(filter.box().width, 100, 1e-9);
}

TEST(BoxFilter, TheBackgroundsMotionIsNotTheObjects) {
  BoxFilter filter({}, {100, 100, 50, 100});
  for (int i = 0; i < 20; ++i) filter.Follow({}, 1 / 30.0, {10, 0}, 1, {10, 0});
  EXPECT_NEAR(filter.box().x, 300, 1e-9);
  EXPECT_NEAR(filter.velocity_px_s().x(), 0, 1e-9);
}

TEST(BoxFilter, ANoisierDetectionMovesItLess) {
  BoxFilter sure({}, {100, 100, 50, 100});
  sure.Predict({}, 1 / 30.0);
  BoxFilter doubtful = sure;
  sure.Update({}, {110, 100, 50, 100});
  doubtful.Update({}, {110, 100, 50, 100}, 4);
  EXPECT_GT(doubtful.box().x, 100);
  EXPECT_LT(doubtful.box().x, sure.box().x);
}

}  // namespace
}  // namespace dynamic_slam
