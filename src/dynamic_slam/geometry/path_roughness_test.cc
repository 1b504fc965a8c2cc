#include "dynamic_slam/geometry/path_roughness.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

constexpr int kPoses = 300;

// A camera that goes round once in ten seconds, 30 frames a second.
Trajectory Round() {
  Trajectory path;
  for (int i = 0; i < kPoses; ++i) {
    const double angle = 2 * std::numbers::pi * i / kPoses;
    path.push_back({i / 30.0, Rigid3(Eigen::Quaterniond::Identity(), {std::cos(angle), std::sin(angle), 0})});
  }
  return path;
}

// Each pose is so far above or below.
void Shake(int begin, int end, double by, Trajectory* path) {
  for (int i = begin; i < end; ++i)
    (*path)[static_cast<size_t>(i)].world_from_cam.translation.z() += i % 2 == 0 ? by : -by;
}

// In another world.
Trajectory Moved(Trajectory path, double scale) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(1, Eigen::Vector3d(1, 2, 3).normalized()));
  for (StampedPose& pose : path) {
    pose.world_from_cam.translation =
        scale * (turn * pose.world_from_cam.translation) + Eigen::Vector3d(1, 2, 3);
  }
  return path;
}

TEST(RoughnessWhereTheyDiffer, IsThatOfPosesThatAreBesideThePath) {
  Trajectory shaken = Round();
  Shake(0, 60, 0.01, &shaken);
  const auto [smooth, rough] = RoughnessWhereTheyDiffer(Round(), shaken);
  const double step = 2 * std::numbers::pi / kPoses;
  EXPECT_NEAR(smooth, step * step, 0.05 * step * step) << "of the curve";
  EXPECT_NEAR(rough, 0.04, 0.002) << "from below to above and back";
}

TEST(RoughnessWhereTheyDiffer, OneAskedTheOtherWayRoundAnswersTheSame) {
  Trajectory shaken = Round();
  Shake(0, 60, 0.01, &shaken);
  const auto [smooth, rough] = RoughnessWhereTheyDiffer(Round(), shaken);
  const auto [rough_first, smooth_second] = RoughnessWhereTheyDiffer(shaken, Round());
  EXPECT_NEAR(rough_first, rough, 0.01 * rough);
  EXPECT_NEAR(smooth_second, smooth, 0.01 * smooth);
}

// As maps have worlds and units of their own.
TEST(RoughnessWhereTheyDiffer, IsInTheUnitOfTheFirst) {
  Trajectory shaken = Round();
  Shake(0, 60, 0.01, &shaken);
  const auto [smooth, rough] = RoughnessWhereTheyDiffer(Round(), shaken);
  const auto [smooth_too, rough_too] = RoughnessWhereTheyDiffer(Round(), Moved(shaken, 7));
  EXPECT_NEAR(smooth_too, smooth, 0.01 * smooth);
  EXPECT_NEAR(rough_too, rough, 0.01 * rough);
}

// Both are rough elsewhere, the smooth one by more.
TEST(RoughnessWhereTheyDiffer, WhereTheyAgreeItSaysNothing) {
  Trajectory one = Round(), other = Round();
  Shake(100, kPoses, 0.01, &one);
  Shake(100, kPoses, 0.01, &other);
  for (size_t i = 0; i < 40; ++i) other[i].world_from_cam.translation.x() += 0.2;
  Shake(0, 40, 0.005, &other);
  const auto [smooth, rough] = RoughnessWhereTheyDiffer(one, other);
  EXPECT_LT(smooth, 0.2 * rough);
  EXPECT_NEAR(rough, 0.0246, 0.001) << "38 of 0.02, and one over the step";
}

TEST(RoughnessWhereTheyDiffer, IsOfPosesThatBothHaveAndThatFollowEachOther) {
  Trajectory shaken = Round(), with_gap = Round();
  Shake(0, 60, 0.01, &shaken);
  Shake(100, kPoses, 0.01, &with_gap);
  with_gap.erase(with_gap.begin() + 100, with_gap.end());
  with_gap.erase(with_gap.begin() + 20, with_gap.begin() + 30);
  const auto [rough, smooth] = RoughnessWhereTheyDiffer(shaken, with_gap);
  EXPECT_NEAR(rough, 0.04, 0.002);
  EXPECT_LT(smooth, 0.01);
}

TEST(RoughnessWhereTheyDiffer, IsNothingWhereThereIsNothingToCompare) {
  const std::pair nothing(0.0, 0.0);
  Trajectory later = Round(), straight = Round();
  for (StampedPose& pose : later) pose.timestamp_s += 100;
  for (StampedPose& pose : straight) pose.world_from_cam.translation = {pose.timestamp_s, 0, 0};
  EXPECT_EQ(RoughnessWhereTheyDiffer({}, {}), nothing);
  EXPECT_EQ(RoughnessWhereTheyDiffer(Round(), later), nothing);
  EXPECT_EQ(RoughnessWhereTheyDiffer(straight, straight), nothing);
  EXPECT_EQ(RoughnessWhereTheyDiffer(Round(), Moved(Round(), 7)), nothing);
}

}  // namespace
}  // namespace dynamic_slam
