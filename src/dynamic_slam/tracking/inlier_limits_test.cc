#include "dynamic_slam/tracking/inlier_limits.h"

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

TEST(InlierLimitsTest, GrowWithKeypointsAndOnlyThoseFoundWithMovers) {
  TrackerOptions options;
  options.min_inliers = 30;
  options.movers_min_inliers = 50;
  const InlierLimits few = NeededInliers(options, 400, 0), usual = NeededInliers(options, 1000, 0);
  EXPECT_EQ(few.found, 30);
  EXPECT_EQ(few.right, 30);
  EXPECT_EQ(usual.found, 30);
  const InlierLimits many = NeededInliers(options, 2000, 0), among_movers = NeededInliers(options, 2000, 0.5);
  EXPECT_EQ(many.found, 60);
  EXPECT_EQ(many.right, 60);
  EXPECT_EQ(among_movers.found, 80);
  EXPECT_EQ(among_movers.right, 60);
}

TEST(InlierLimitsTest, MoversNeverLowerThem) {
  TrackerOptions options;
  options.min_inliers = 40;
  options.movers_min_inliers = 20;
  EXPECT_EQ(NeededInliers(options, 1000, 1).found, 40);
}

}  // namespace
}  // namespace dynamic_slam
