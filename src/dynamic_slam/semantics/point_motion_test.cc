#include "dynamic_slam/semantics/point_motion.h"

#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

const Box kBox{100, 100, 100, 200};

// Points all over the box that move by the shift and grow about the box's centre.
std::vector<PointMotion> Points(const Eigen::Vector2d& shift, double scale) {
  const Eigen::Vector2d centre(150, 200);
  std::vector<PointMotion> motions;
  for (double x = 105; x < 200; x += 10) {
    for (double y = 105; y < 300; y += 10) {
      const Eigen::Vector2d from(x, y);
      motions.push_back({from, centre + scale * (from - centre) + shift});
    }
  }
  return motions;
}

std::vector<std::optional<BoxMotion>> Estimate(const std::vector<Box>& boxes,
                                               const std::vector<Eigen::Vector2d>& expected_px,
                                               const std::vector<PointMotion>& motions) {
  BoxMotionEstimator estimator;
  const auto estimates = estimator.Estimate(boxes, expected_px, motions);
  return {estimates.begin(), estimates.end()};
}

const std::vector<Eigen::Vector2d> kStill = {Eigen::Vector2d::Zero()};

TEST(BoxMotionEstimator, FindsShiftAndScale) {
  const auto motion = Estimate({kBox}, kStill, Points({6, -4}, 1.04))[0];
  ASSERT_TRUE(motion);
  EXPECT_NEAR(motion->scale, 1.04, 1e-9);
  EXPECT_NEAR(motion->shift_px.x(), 6, 0.3);
  EXPECT_NEAR(motion->shift_px.y(), -4, 0.3);
}

TEST(BoxMotionEstimator, BearsPointsOfTheBackground) {
  std::vector<PointMotion> motions = Points({6, -4}, 1);
  for (size_t i = 0; i < motions.size(); ++i) {
    if (i % 5 < 2) motions[i].to_px = motions[i].from_px + Eigen::Vector2d(-9, 9);
  }
  const auto motion = Estimate({kBox}, kStill, motions)[0];
  ASSERT_TRUE(motion);
  EXPECT_NEAR(motion->shift_px.x(), 6, 1);
  EXPECT_NEAR(motion->shift_px.y(), -4, 1);
}

TEST(BoxMotionEstimator, NeedsPointsInsideTheBox) { EXPECT_FALSE(Estimate({kBox}, kStill, {})[0]); }

TEST(BoxMotionEstimator, ABoxMovesAsThePointsInItsMiddle) {
  // At its sides, columns up to 125 and from 175, something else moves.
  std::vector<PointMotion> motions = Points({6, -4}, 1);
  for (PointMotion& motion : motions) {
    if (std::abs(motion.from_px.x() - 150) > 25) motion.to_px = motion.from_px + Eigen::Vector2d(50, 50);
  }
  const auto found = Estimate({kBox, {300, 100, 100, 200}}, {2, Eigen::Vector2d::Zero()}, motions);
  ASSERT_EQ(found.size(), 2u);
  ASSERT_TRUE(found[0]);
  EXPECT_NEAR(found[0]->shift_px.x(), 6, 1e-9);
  EXPECT_NEAR(found[0]->shift_px.y(), -4, 1e-9);
  EXPECT_FALSE(found[1]);
}

TEST(BoxMotionEstimator, APointInTwoBoxesIsOfTheOneWhoseMotionItFits) {
  // The second box covers the first one's middle.
  const std::vector<Box> boxes = {kBox, {60, 100, 150, 200}};
  const auto points = Points({6, -4}, 1);
  auto found = Estimate(boxes, {{0, 0}, {7, -4}}, points);
  EXPECT_FALSE(found[0]);
  EXPECT_TRUE(found[1]);
  // Both move alike: the points say something of both.
  found = Estimate(boxes, {{6, -4}, {6.5, -4}}, points);
  EXPECT_TRUE(found[0]);
  EXPECT_TRUE(found[1]);
}

TEST(BoxMotionEstimator, SkipsPointsThatAreNowhere) {
  auto points = Points({6, -4}, 1);
  for (PointMotion& point : points) point.to_px.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(Estimate({kBox}, {{6, -4}}, points)[0]);
}

TEST(BoxMotionEstimator, NothingOfACallReachesTheNext) {
  BoxMotionEstimator estimator;
  const std::vector<Box> boxes = {kBox};
  estimator.Estimate(boxes, kStill, Points({6, -4}, 1));
  EXPECT_FALSE(estimator.Estimate(boxes, kStill, {})[0]);
  EXPECT_NEAR(estimator.Estimate(boxes, kStill, Points({-3, 2}, 1))[0]->shift_px.x(), -3, 1e-9);
}

}  // namespace
}  // namespace dynamic_slam
