// Real sequences: bounds that only a change for the worse breaks.

#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/test_folder.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "whole_run.h"

namespace dynamic_slam {
namespace {

class DatasetTest : public FolderTest {
 protected:
  void SetUp() override {
    if (SharedData().empty()) GTEST_SKIP() << "DYNAMIC_SLAM_DATA is not set: no real images";
  }

  // camera: a name, or "" for the sequence's own. Bounds of rmse in m and of coverage.
  void Check(const std::string& name, const std::string& camera, double max_rmse_m, double min_coverage) {
    const std::filesystem::path folder = SharedData() / name;
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " does not exist";
    const auto source = OpenFrameSource(folder);
    const WholeRun run = RunAll(*source, camera.empty() ? source->OwnCamera().value() : LoadCamera(camera));
    EXPECT_GE(run.summary.Coverage(), min_coverage) << run.summary.last_reason;
    EXPECT_THAT(run.system->map().Read()->Validate(), testing::IsEmpty());
    const auto truth = LoadGroundTruth(folder);
    ASSERT_TRUE(truth.has_value());
    const double rmse_m = ApeRmse(*truth, run.system->FrameTrajectory());
    EXPECT_LE(rmse_m, max_rmse_m);
    WriteResults(folder_, *run.system, run.summary);
    std::cout << name << ": APE rmse " << rmse_m << " m, coverage " << run.summary.Coverage() << "\n";
  }
};

TEST_F(DatasetTest, Fr1Desk) { Check("tum_fr1_desk", "tum_fr1", 0.020, 0.95); }

TEST_F(DatasetTest, Kitti00First200) {
  Check("kitti_00_first200/sequences/00", "", 0.80, 0.97);
  if (IsSkipped() || HasFailure()) return;
  EXPECT_EQ(ReadKittiPoses(folder_ / "trajectory_kitti.txt").size(), 200u) << "every frame has a pose";
}

TEST_F(DatasetTest, RedKitchen) { Check("sevenscenes_redkitchen", "sevenscenes", 0.05, 0.95); }

// How accurate a run in real time is depends on the machine and what else it does; these hold on any.
TEST_F(DatasetTest, Fr1DeskInRealTime) {
  const std::filesystem::path sequence = SharedData() / "tum_fr1_desk";
  if (!std::filesystem::exists(sequence)) GTEST_SKIP() << sequence << " does not exist";
  const auto source = OpenFrameSource(sequence);
  SlamSystem system(LoadCamera("tum_fr1"), {}, RunMode::kRealtime);
  const RunSummary summary = RunSequence(*source, system);
  EXPECT_EQ(summary.failure, nullptr) << FailureMessage(summary);
  EXPECT_TRUE(summary.initialised_at.has_value()) << summary.last_reason;
  EXPECT_LE(summary.most_keyframes_waiting, 5);
  EXPECT_EQ(summary.frames.size() + summary.frames_dropped + summary.skipped.size(), 613u);
  EXPECT_THAT(system.map().Read()->Validate(), testing::IsEmpty());
}

TEST_F(DatasetTest, TwoRunsOfFr1DeskGiveTheSameBytes) {
  const std::filesystem::path sequence = SharedData() / "tum_fr1_desk";
  if (!std::filesystem::exists(sequence)) GTEST_SKIP() << sequence << " does not exist";
  for (const char* name : {"a", "b"}) {
    const auto source = OpenFrameSource(sequence, {.max_frames = 150});
    const WholeRun run = RunAll(*source, LoadCamera("tum_fr1"));
    WriteResults(folder_ / name, *run.system, run.summary);
  }
  for (const char* name : {"trajectory.txt", "map.ply"}) {
    EXPECT_GT(std::filesystem::file_size(folder_ / "a" / name), 1000u) << name;
    EXPECT_TRUE(ReadFile(folder_ / "a" / name) == ReadFile(folder_ / "b" / name)) << name << " differs";
  }
}

}  // namespace
}  // namespace dynamic_slam
