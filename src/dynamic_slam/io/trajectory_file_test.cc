#include "dynamic_slam/io/trajectory_file.h"

#include <string>

#include <gmock/gmock.h>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/base/test_folder.h"

namespace dynamic_slam {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class TrajectoryFile : public FolderTest {};

Trajectory RandomTrajectory(int count) {
  Random random(7);
  Trajectory trajectory;
  for (int i = 0; i < count; ++i) {
    const Eigen::Quaterniond q(random.Gaussian(), random.Gaussian(), random.Gaussian(), random.Gaussian());
    trajectory.push_back(
        {1305031452.791720 + 0.1 * i,
         Rigid3(q.normalized(), {random.Gaussian(), random.Gaussian(), 100 * random.Gaussian()})});
  }
  return trajectory;
}

TEST_F(TrajectoryFile, TumReadsBackAndIsReproducible) {
  const Trajectory written = RandomTrajectory(50);
  WriteTumTrajectory(folder_ / "a.txt", written);
  const Trajectory read = ReadTumTrajectory(folder_ / "a.txt");
  ASSERT_EQ(read.size(), written.size());
  for (size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].timestamp_s, written[i].timestamp_s);
    EXPECT_LT((read[i].world_from_cam.translation - written[i].world_from_cam.translation).norm(), 1e-9);
    EXPECT_LT(RotationAngle(read[i].world_from_cam.rotation, written[i].world_from_cam.rotation), 1e-8);
    EXPECT_GE(read[i].world_from_cam.rotation.w(), 0);
  }
  WriteTumTrajectory(folder_ / "b.txt", written);
  EXPECT_EQ(ReadFile(folder_ / "a.txt"), ReadFile(folder_ / "b.txt"));
}

TEST_F(TrajectoryFile, TumTextIsFixed) {
  const StampedPose pose{1.5, Rigid3(Eigen::Quaterniond(-0.6, 0, 0.8, 0), {1, -2, 0.25})};
  WriteTumTrajectory(folder_ / "a.txt", {&pose, 1});
  EXPECT_EQ(ReadFile(folder_ / "a.txt"),
            "# timestamp tx ty tz qx qy qz qw (world_from_cam)\n"
            "1.500000000 1.000000000 -2.000000000 0.250000000 -0.000000000 -0.800000000 -0.000000000 "
            "0.600000000\n");
}

TEST_F(TrajectoryFile, TumTakesCommentsBlanksAndRoundedQuaternions) {
  const Trajectory t = ReadTumTrajectory(
      Write("a.txt", "# comment\r\n\r\n  0.5 1 2 3 0.7907 0.4393 -0.1770 -0.3879 \r\n1e0,1,2,3,0,0,0,1\n"));
  ASSERT_EQ(t.size(), 2u);
  EXPECT_EQ(t[0].timestamp_s, 0.5);
  EXPECT_EQ(t[0].world_from_cam.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_NEAR(t[0].world_from_cam.rotation.norm(), 1, 1e-15);
  EXPECT_NEAR(t[0].world_from_cam.rotation.x(), 0.7907, 1e-4);
  EXPECT_EQ(t[1].timestamp_s, 1);
}

TEST_F(TrajectoryFile, TumErrorsNameTheLine) {
  const auto error = [this](const std::string& line) {
    const auto file = Write("bad.txt", "# c\n1 0 0 0 0 0 0 1\n" + line + "\n");
    return ErrorOf([&] { ReadTumTrajectory(file); });
  };
  EXPECT_THAT(error("2 0 0 0 0 0 1"), HasSubstr("bad.txt:3: 7 columns, 8 are wanted"));
  EXPECT_THAT(error("2 0 0 0 0 0 0 1 5"), HasSubstr("bad.txt:3: 9 columns"));
  EXPECT_THAT(error("2 0 zero 0 0 0 0 1"), HasSubstr("bad.txt:3: 'zero' is not a number"));
  EXPECT_THAT(error("2 0 nan 0 0 0 0 1"), HasSubstr("bad.txt:3: 'nan' is not finite"));
  EXPECT_THAT(error("2 0 0 0 0 0 0 2"), HasSubstr("bad.txt:3: the quaternion's norm is 2, not 1"));
  EXPECT_THAT(error("2 0 0 0 0 0 0 0"), HasSubstr("bad.txt:3: the quaternion's norm is 0, not 1"));
  EXPECT_THAT(error("0.5 0 0 0 0 0 0 1"), HasSubstr("bad.txt:3: the stamp 0.500000000 is before"));
  EXPECT_EQ(error("2 0 0 0 0 0 0 1"), "");
  EXPECT_THAT(ErrorOf([&] { ReadTumTrajectory(Write("empty.txt", "# c\n")); }), HasSubstr("holds no data"));
  EXPECT_THAT(ErrorOf([&] { ReadTumTrajectory(folder_ / "absent.txt"); }), HasSubstr("No such file"));
}

TEST_F(TrajectoryFile, KittiReadsBack) {
  std::vector<Rigid3> written;
  for (const StampedPose& pose : RandomTrajectory(20)) written.push_back(pose.world_from_cam);
  WriteKittiPoses(folder_ / "a.txt", written);
  const std::vector<Rigid3> read = ReadKittiPoses(folder_ / "a.txt");
  ASSERT_EQ(read.size(), written.size());
  for (size_t i = 0; i < read.size(); ++i) {
    EXPECT_LT((read[i].translation - written[i].translation).norm(), 1e-9);
    EXPECT_LT(RotationAngle(read[i].rotation, written[i].rotation), 1e-8);
  }
}

TEST_F(TrajectoryFile, KittiMatricesKeepTheFilesNumbers) {
  const auto file = Write("a.txt", "1 1e-4 0 4 -1e-4 1 0 5 0 0 0.9999 6\n");
  const std::vector<KittiMatrix> matrices = ReadKittiMatrices(file);
  ASSERT_EQ(matrices.size(), 1u);
  EXPECT_EQ(matrices[0](0, 1), 1e-4);
  EXPECT_EQ(matrices[0](2, 2), 0.9999);
  EXPECT_EQ(matrices[0].col(3), Eigen::Vector3d(4, 5, 6));
}

TEST_F(TrajectoryFile, KittiErrorsNameTheLine) {
  const std::string good = "1 0 0 0 0 1 0 0 0 0 1 0\n";
  EXPECT_THAT(ErrorOf([&] { ReadKittiPoses(Write("a.txt", good + "1 2 3\n")); }),
              HasSubstr("a.txt:2: 3 columns, 12 are wanted"));
  EXPECT_THAT(ErrorOf([&] { ReadKittiPoses(Write("b.txt", good + "2 0 0 0 0 1 0 0 0 0 1 0\n")); }),
              HasSubstr("b.txt:2: the first three columns are no rotation"));
  EXPECT_THAT(ErrorOf([&] { ReadKittiPoses(Write("c.txt", good + "-1 0 0 0 0 1 0 0 0 0 1 0\n")); }),
              HasSubstr("c.txt:2: the first three columns are no rotation"));
}

TEST_F(TrajectoryFile, TimesMustNotGoBack) {
  EXPECT_THAT(ReadTimes(Write("a.txt", "0.0\n1.036e-01\n0.2\n")), ElementsAre(0, 0.1036, 0.2));
  EXPECT_THAT(ErrorOf([&] { ReadTimes(Write("b.txt", "0.0\n0.2\n0.1\n")); }),
              HasSubstr("b.txt:3: the stamp"));
}

TEST_F(TrajectoryFile, FindsGroundTruth) {
  EXPECT_FALSE(LoadGroundTruth(folder_).has_value());
  Write("tum/groundtruth.txt", "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n");
  ASSERT_TRUE(LoadGroundTruth(folder_ / "tum").has_value());
  EXPECT_EQ(LoadGroundTruth(folder_ / "tum")->size(), 2u);

  Write("kitti/poses/07.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 3\n");
  Write("kitti/sequences/07/times.txt", "0\n0.1\n0.2\n");
  for (const char* path : {"kitti/sequences/07", "kitti/sequences/07/"}) {
    const auto truth = LoadGroundTruth(folder_ / path);
    ASSERT_TRUE(truth.has_value()) << path;
    ASSERT_EQ(truth->size(), 2u);
    EXPECT_EQ(truth->at(1).timestamp_s, 0.1);
    EXPECT_EQ(truth->at(1).world_from_cam.translation.z(), 3);
  }
}

TEST_F(TrajectoryFile, ReadsAllSharedTrajectories) {
  if (SharedData().empty()) GTEST_SKIP() << "DYNAMIC_SLAM_DATA is not set";
  int files = 0;
  for (const auto& item : std::filesystem::directory_iterator(SharedData() / "trajectories")) {
    const std::string name = item.path().filename().string();
    if (item.path().extension() != ".txt") continue;
    ++files;
    if (name.starts_with("KITTI")) {
      EXPECT_EQ(ReadKittiPoses(item.path()).size(), 4541u) << name;
    } else {
      EXPECT_GT(ReadTumTrajectory(item.path()).size(), 30u) << name;
    }
  }
  EXPECT_GE(files, 8);
  EXPECT_EQ(LoadGroundTruth(SharedData() / "kitti_00_first200/sequences/00")->size(), 200u);
  EXPECT_GT(LoadGroundTruth(SharedData() / "tum_fr1_desk")->size(), 2000u);
  EXPECT_GE(LoadGroundTruth(SharedData() / "sevenscenes_redkitchen")->size(), 400u);
}

}  // namespace
}  // namespace dynamic_slam
