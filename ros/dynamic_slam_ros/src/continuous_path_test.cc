#include "continuous_path.h"

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

Rigid3 At(double x) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.1 * x, Eigen::Vector3d::UnitZ())), Eigen::Vector3d(x, 0, 0)};
}

double Distance(const Rigid3& a, const Rigid3& b) {
  return (a.translation - b.translation).norm() + RotationAngle(a.rotation, b.rotation);
}

TEST(ContinuousPathTest, FollowsTheMapUntilItIsCorrected) {
  ContinuousPath path;
  for (const double x : {1.0, 2.0, 3.0}) path.Add(At(x), false);
  EXPECT_LT(Distance(path.odom_from_body(), At(1).Inverse() * At(3)), 1e-12);
  EXPECT_LT(Distance(path.map_from_odom(), At(1)), 1e-12);
}

TEST(ContinuousPathTest, AJumpIsInTheMapOnly) {
  ContinuousPath path;
  path.Add(At(1), false);
  path.Add(At(2), false);
  const Rigid3 before = path.odom_from_body();
  path.Add(At(9), true);
  EXPECT_EQ(path.odom_from_body(), before);
  EXPECT_FALSE(path.last_from_body().has_value());
  EXPECT_LT(Distance(path.map_from_odom() * path.odom_from_body(), At(9)), 1e-12);
  path.Add(At(10), false);
  EXPECT_LT(Distance(path.odom_from_body(), before * At(9).Inverse() * At(10)), 1e-12);
}

TEST(ContinuousPathTest, GoesOnAfterABreak) {
  ContinuousPath path;
  path.Add(At(1), false);
  path.Add(At(2), false);
  const Rigid3 before = path.odom_from_body();
  path.Break();
  path.Add(At(0), false);
  EXPECT_EQ(path.odom_from_body(), before);
  EXPECT_LT(Distance(path.map_from_odom() * path.odom_from_body(), At(0)), 1e-12);
}

}  // namespace
}  // namespace dynamic_slam
