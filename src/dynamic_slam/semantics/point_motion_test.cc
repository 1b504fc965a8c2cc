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
  motions[1].to_px.x() = std::numeric_limits<double>::quiet_NaN();
  const auto motion = MotionOfBox(kBox, motions);
  ASSERT_TRUE(motion);
  EXPECT_NEAR(motion->shift_px.x(), 6, 1);
  EXPECT_NEAR(motion->shift_px.y(), -4, 1);
}

TEST(MotionOfBox, NeedsPointsInsideTheBox) {
  EXPECT_FALSE(MotionOfBox(kBox, {}));
  EXPECT_FALSE(MotionOfBox({300, 100, 100, 200}, Points({6, -4}, 1)));
}

}  // namespace
}  // namespace dynamic_slam
