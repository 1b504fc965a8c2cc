#include "dynamic_slam/semantics/point_motion.h"

#include <limits>
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

TEST(MotionOfBox, FindsShiftAndScale) {
  const auto motion = MotionOfBox(kBox, Points({6, -4}, 1.04));
  ASSERT_TRUE(motion);
  EXPECT_NEAR(motion->scale, 1.04, 1e-9);
  EXPECT_NEAR(motion->shift_px.x(), 6, 0.3);
  EXPECT_NEAR(motion->shift_px.y(), -4, 0.3);
}

TEST(MotionOfBox, BearsPointsOfTheBackground) {
  std::vector<PointMotion> motions = Points({6, -4}, 1);
  for (size_t i = 0; i < motions.size(); ++i) {
    if (i % 5 < 2) motions[i].to_px = motions[i].from_px + Eigen::Vector2d(-9, 9);
  }
  const auto motion = MotionOfBox(kBox, motions);
  ASSERT_TRUE(motion);
  EXPECT_NEAR(motion->shift_px.x(), 6, 1);
  EXPECT_NEAR(motion->shift_px.y(), -4, 1);
}

TEST(MotionOfBox, NeedsPointsInsideTheBox) { EXPECT_FALSE(MotionOfBox(kBox, {})); }

TEST(ShareMotions, GivesABoxThePointsInItsMiddle) {
  const std::vector<Box> boxes = {kBox, {300, 100, 100, 200}};
  const std::vector<Eigen::Vector2d> expected(2, Eigen::Vector2d::Zero());
  const auto shares = ShareMotions(boxes, expected, Points({6, -4}, 1));
  ASSERT_EQ(shares.size(), 2u);
  EXPECT_EQ(shares[0].size(), 100u);  // columns 125 to 165 ...
  EXPECT_TRUE(shares[1].empty());
}

TEST(ShareMotions, APointInTwoBoxesIsOfTheOneWhoseMotionItFits) {
  // The second box covers the first one's middle.
  const std::vector<Box> boxes = {kBox, {60, 100, 150, 200}};
  const auto points = Points({6, -4}, 1);
  auto shares = ShareMotions(boxes, std::vector<Eigen::Vector2d>{{0, 0}, {7, -4}}, points);
  EXPECT_TRUE(shares[0].empty());
  EXPECT_FALSE(shares[1].empty());
  // Both move alike: the points say something of both.
  shares = ShareMotions(boxes, std::vector<Eigen::Vector2d>{{6, -4}, {6.5, -4}}, points);
  EXPECT_FALSE(shares[0].empty());
  EXPECT_FALSE(shares[1].empty());
}

TEST(ShareMotions, SkipsPointsThatAreNowhere) {
  auto points = Points({6, -4}, 1);
  for (PointMotion& point : points) point.to_px.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(ShareMotions(std::vector{kBox}, std::vector{Eigen::Vector2d(6, -4)}, points)[0].empty());
}

}  // namespace
}  // namespace dynamic_slam
