#include "dynamic_slam/eval/pose_list.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string Write(const std::string& name, const std::string& text) {
  const std::string path =
      ::testing::TempDir() + ::testing::UnitTest::GetInstance()->current_test_info()->name() + name;
  std::ofstream(path) << text;
  return path;
}

template <class Function>
std::string InputErrorOf(Function&& function) {
  try {
    function();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no InputError";
}

std::string TumComplaint(const std::string& text) {
  return InputErrorOf([&] { ReadTumPoses(Write("tum.txt", text)); });
}

std::string KittiComplaint(const std::string& text, const std::string& times = "") {
  return InputErrorOf(
      [&] { ReadKittiPoses(Write("kitti.txt", text), times.empty() ? "" : Write("times.txt", times)); });
}

const char* const kIdentityRow = "1 0 0 0 0 1 0 0 0 0 1 0\n";

TEST(ReadTumPoses, ReadsNumbersExactlyAndSkipsComments) {
  const PoseList poses = ReadTumPoses(Write("ok.txt",
                                            "# a comment\n\n1311868164.363181 0.1 -2e-3 +3 0 0 0 2  # twice "
                                            "the unit\r\n1311868164.5\t1 2 3 1 0 0 0"));
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_EQ(poses[0].timestamp_s, 1311868164.363181);
  EXPECT_EQ(poses[0].position, Eigen::Vector3d(0.1, -2e-3, 3));
  EXPECT_EQ(poses[0].rotation, Eigen::Matrix3d::Identity());
  EXPECT_LT((poses[1].rotation - Eigen::Vector3d(1, -1, -1).asDiagonal().toDenseMatrix()).norm(), 1e-15);
}

TEST(ReadTumPoses, NamesFileLineAndReason) {
  EXPECT_THAT(TumComplaint("0 0 0 0 0 0 0 1\n1 2 3\n"),
              AllOf(HasSubstr("tum.txt:2"), HasSubstr("3 numbers, expected 8")));
  EXPECT_THAT(TumComplaint("0 0 zero 0 0 0 0 1\n"), HasSubstr("'zero' is not a finite number"));
  EXPECT_THAT(TumComplaint("0 0 nan 0 0 0 0 1\n"), HasSubstr("'nan' is not a finite number"));
  EXPECT_THAT(TumComplaint("0 0 1.5x 0 0 0 0 1\n"), HasSubstr("'1.5x' is not a finite number"));
  EXPECT_THAT(TumComplaint("0 0 0 0 0 0 0 0\n"), HasSubstr("the quaternion is zero"));
  EXPECT_THAT(TumComplaint("1 0 0 0 0 0 0 1\n0.5 0 0 0 0 0 0 1\n"), HasSubstr("stamp 0.5 comes after 1"));
  EXPECT_THAT(TumComplaint("# nothing\n"), HasSubstr("holds no data"));
  EXPECT_THAT(TumComplaint(kIdentityRow), HasSubstr("12 numbers, expected 8"));
  EXPECT_THAT(InputErrorOf([] { ReadTumPoses("/nowhere/at/all.txt"); }),
              HasSubstr("/nowhere/at/all.txt: cannot be opened"));
}

TEST(ReadKittiPoses, KeepsTheMatrixAsItIs) {
  const PoseList poses =
      ReadKittiPoses(Write("ok.txt", "0.9999 0 0 1 0 1.0001 0 2 0 0 1 3\n1 0 0 4 0 1 0 5 0 0 1 6\n"), "");
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_EQ(poses[0].rotation(0, 0), 0.9999);
  EXPECT_EQ(poses[0].rotation(1, 1), 1.0001);
  EXPECT_EQ(poses[1].position, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(poses[1].timestamp_s, 1.0);
}

TEST(ReadKittiPoses, TakesStampsFromTimes) {
  const PoseList poses = ReadKittiPoses(Write("ok.txt", std::string(kIdentityRow) + kIdentityRow),
                                        Write("times.txt", "0.000000e+00\n1.036e-01\n"));
  EXPECT_EQ(poses[1].timestamp_s, 0.1036);
}

TEST(ReadKittiPoses, NamesFileLineAndReason) {
  EXPECT_THAT(KittiComplaint("0 0 0 0 0 0 0 1\n"), HasSubstr("8 numbers, expected 12"));
  EXPECT_THAT(KittiComplaint("2 0 0 0 0 1 0 0 0 0 1 0\n"), HasSubstr("not a rotation"));
  EXPECT_THAT(KittiComplaint(kIdentityRow, "0\n1\n"), HasSubstr("2 stamps for the 1 poses"));
  EXPECT_THAT(KittiComplaint(std::string(kIdentityRow) + kIdentityRow, "1\n0\n"),
              AllOf(HasSubstr("times.txt:2"), HasSubstr("before the one above")));
}

TEST(ToPoseList, KeepsStampsAndPoses) {
  const Trajectory trajectory{{1.5, Rigid3(ExpSo3({0.1, 0.2, 0.3}), {1, 2, 3})}};
  const PoseList poses = ToPoseList(trajectory);
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_EQ(poses[0].timestamp_s, 1.5);
  EXPECT_EQ(poses[0].rotation, trajectory[0].world_from_cam.Matrix());
  EXPECT_EQ(poses[0].position, Eigen::Vector3d(1, 2, 3));
}

}  // namespace
}  // namespace dynamic_slam
