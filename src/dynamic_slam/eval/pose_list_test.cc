#include "dynamic_slam/eval/pose_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

TEST(ToPoseList, KeepsStampsAndPoses) {
  const Trajectory trajectory{{1.5, Rigid3(ExpSo3({0.1, 0.2, 0.3}), {1, 2, 3})}};
  const PoseList poses = ToPoseList(trajectory);
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_EQ(poses[0].timestamp_s, 1.5);
  EXPECT_EQ(poses[0].rotation, trajectory[0].world_from_cam.Matrix());
  EXPECT_EQ(poses[0].position, Eigen::Vector3d(1, 2, 3));
}

TEST(PathLength, SumsTheSteps) {
  PoseList poses(3);
  EXPECT_EQ(PathLength({}), 0);
  poses[1].position = {3, 4, 0};
  poses[2].position = {3, 4, 2};
  EXPECT_DOUBLE_EQ(PathLength(poses), 7);
}

TEST(ToPoseList, KeepsTheRoundedRotationsOfKitti) {
  std::vector<Eigen::Matrix<double, 3, 4>> matrices(2, Eigen::Matrix<double, 3, 4>::Identity());
  matrices[1] << 0.9999, 0, 0, 4, 0, 1.0001, 0, 5, 0, 0, 1, 6;
  const PoseList by_row = ToPoseList(matrices, {});
  EXPECT_EQ(by_row[1].rotation, Eigen::Vector3d(0.9999, 1.0001, 1).asDiagonal().toDenseMatrix());
  EXPECT_EQ(by_row[1].position, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(by_row[1].timestamp_s, 1.0);
  const std::vector<double> times_s = {0.0, 0.1036};
  EXPECT_EQ(ToPoseList(matrices, times_s)[1].timestamp_s, 0.1036);
}

TEST(ToPoseList, NeedsAStampForEachPose) {
  const std::vector<Eigen::Matrix<double, 3, 4>> matrices(3, Eigen::Matrix<double, 3, 4>::Identity());
  const std::vector<double> times_s = {0.0, 0.1};
  EXPECT_THAT([&] { ToPoseList(matrices, times_s); },
              ::testing::ThrowsMessage<InputError>(::testing::HasSubstr("2 stamps for 3 poses")));
}

}  // namespace
}  // namespace dynamic_slam
