#include "dynamic_slam/system/run_journal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

using testing::HasSubstr;

class RunJournalTest : public testing::Test {
 protected:
  RunJournalTest() { std::filesystem::create_directories(folder_); }
  ~RunJournalTest() override { std::filesystem::remove_all(folder_); }

  static Rigid3 PoseAt(int i) { return Rigid3(ExpSo3({0.1 * i, 0.2, 0}), {1.0 * i, 2, -3}); }

  // Frame i at i / 10 s; a part of -1: without a pose.
  static void Add(int i, int part, RunJournal* journal, bool map_was_erased = false) {
    RunSummary::FrameRecord record;
    record.timestamp_s = 0.1 * i;
    record.state = part < 0 ? TrackingState::kLost : TrackingState::kTracking;
    record.map_was_erased = map_was_erased;
    journal->Add(record, part < 0 ? "12 inliers, 35 needed" : "",
                 PartId(static_cast<uint32_t>(std::max(part, 0))), PoseAt(i));
  }

  std::filesystem::path folder_ =
      std::filesystem::path(testing::TempDir()) /
      (std::string("journal_") + testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(RunJournalTest, TellsWhatItWasTold) {
  RunJournal journal(folder_);
  for (int i = 0; i < 10; ++i) Add(i, i < 4 ? 0 : i == 4 ? -1 : 1, &journal);
  const RecoveredRun run = ReadJournal(folder_);
  EXPECT_EQ(run.frames, 10u);
  ASSERT_EQ(run.trajectories.size(), 2u);
  ASSERT_EQ(run.trajectories[0].size(), 5u);  // the larger part first
  ASSERT_EQ(run.trajectories[1].size(), 4u);
  for (const Trajectory& trajectory : run.trajectories) {
    for (const StampedPose& pose : trajectory) {
      const Rigid3 expected = PoseAt(static_cast<int>(std::lround(10 * pose.timestamp_s)));
      EXPECT_TRUE(pose.world_from_cam.translation.isApprox(expected.translation, 1e-12));
      EXPECT_TRUE(pose.world_from_cam.rotation.isApprox(expected.rotation, 1e-12));
    }
  }
  EXPECT_THAT(run.frames_csv, HasSubstr("\n0.400000000,lost,"));
  EXPECT_THAT(run.frames_csv, HasSubstr("\"12 inliers, 35 needed\""));
  EXPECT_EQ(std::count(run.frames_csv.begin(), run.frames_csv.end(), '\n'), 11);
}

TEST_F(RunJournalTest, AnOlderOneIsKept) {
  for (int run = 0; run < 3; ++run) {  // each is killed
    RunJournal journal(folder_);
    EXPECT_EQ(journal.kept(),
              run == 0 ? std::filesystem::path() : folder_ / fmt::format("journal.{}.csv", run));
    for (int i = 0; i < 3 + run; ++i) Add(i, 0, &journal);
  }
  EXPECT_EQ(ReadJournal(folder_ / "journal.1.csv").frames, 3u);
  EXPECT_EQ(ReadJournal(folder_ / "journal.2.csv").frames, 4u);
  EXPECT_EQ(ReadJournal(folder_).frames, 5u);
  { RunJournal without_frames(folder_); }
  RunJournal journal(folder_);
  EXPECT_TRUE(journal.kept().empty());
}

TEST_F(RunJournalTest, APartThatWasErasedIsGone) {
  RunJournal journal(folder_);
  for (int i = 0; i < 5; ++i) Add(i, 0, &journal);
  Add(5, -1, &journal, true);
  for (int i = 6; i < 9; ++i) Add(i, 1, &journal);
  const RecoveredRun run = ReadJournal(folder_);
  ASSERT_EQ(run.trajectories.size(), 1u);
  EXPECT_EQ(run.trajectories[0].size(), 3u);
}

TEST_F(RunJournalTest, CutOffAnywhereItTellsTheLinesBefore) {
  {
    RunJournal journal(folder_);
    for (int i = 0; i < 2; ++i) Add(i, 0, &journal);
  }
  const std::string whole = ReadFile(folder_ / RunJournal::kFileName);
  for (size_t size = whole.find('\n') + 1; size <= whole.size(); ++size) {
    WriteFileAtomically(folder_ / RunJournal::kFileName, whole.substr(0, size));
    const auto lines =
        static_cast<size_t>(std::count(whole.begin(), whole.begin() + static_cast<long>(size), '\n')) - 1;
    const RecoveredRun run = ReadJournal(folder_);
    EXPECT_EQ(run.frames, lines);
    EXPECT_EQ(run.trajectories.size(), lines > 0 ? 1u : 0u);
    if (lines > 0) {
      EXPECT_EQ(run.trajectories[0].size(), lines);
    }
  }
}

TEST_F(RunJournalTest, WhatIsNoJournalIsRefused) {
  const auto complaint = [this] {
    try {
      ReadJournal(folder_);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(complaint(), HasSubstr("is not there"));
  WriteFileAtomically(folder_ / RunJournal::kFileName, "");
  EXPECT_THAT(complaint(), HasSubstr("journal.csv:1: is no line of a journal"));
  WriteFileAtomically(folder_ / RunJournal::kFileName, "ply\n");
  EXPECT_THAT(complaint(), HasSubstr("journal.csv:1: is no line of a journal"));
  {
    RunJournal journal(folder_);
    Add(0, 0, &journal);
  }
  const std::string whole = ReadFile(folder_ / RunJournal::kFileName);
  const size_t header = whole.find('\n') + 1;
  for (const char* line :
       {"hello\n", "0,0,1,2\n", "0,0,nan,0,0,0,0,0,1,0.1,tracking,\n", "0,0,0,0,0,0,0,0,9,0.1,tracking,\n",
        "0,-1,0,0,0,0,0,0,1,0.1,tracking,\n", "0,0,0,0,0,0,0,0,1,,tracking,\n"}) {
    WriteFileAtomically(folder_ / RunJournal::kFileName, whole.substr(0, header) + line);
    EXPECT_THAT(complaint(), HasSubstr("journal.csv:2: is no line of a journal")) << line;
  }
}

TEST_F(RunJournalTest, ItGoesWhenTheResultsAreThere) {
  RunJournal journal(folder_);
  Add(0, 0, &journal);
  journal.Remove();
  EXPECT_FALSE(std::filesystem::exists(folder_ / RunJournal::kFileName));
  Add(1, 0, &journal);  // harmless
}

TEST_F(RunJournalTest, AFolderThatIsNotThereIsAnError) {
  EXPECT_THROW(RunJournal(folder_ / "nowhere"), InputError);
}

}  // namespace
}  // namespace dynamic_slam
