// Every way in which a run begins, ends, fails and begins again, offline and in realtime mode.

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/map/map_file.h"
#include "dynamic_slam/system/slam_system.h"
#include "small_room.h"
#include "whole_run.h"

namespace dynamic_slam {
namespace {

using namespace std::chrono_literals;
using testing::IsEmpty;

// The system's own executor, whose tasks can be made to throw or to wait for the wish to stop.
class FaultyExecutor : public Executor {
 public:
  enum class Fault { kNone, kThrow, kWaitForStop, kThrowInTracking };

  explicit FaultyExecutor(RunMode mode)
      : executor_(mode == RunMode::kOffline ? MakeInlineExecutor() : MakeThreadedExecutor()) {}

  void Post(Lane lane, Task task) override {
    executor_->Post(lane, [lane, fault = fault, task = std::move(task), this](const std::stop_token& token) {
      if (fault == Fault::kThrow) throw std::runtime_error("disk full");
      while (fault == Fault::kWaitForStop && !token.stop_requested()) std::this_thread::sleep_for(1ms);
      task(token);
      done += lane == Lane::kMapping;
    });
  }
  int Waiting(Lane lane) const override {
    // It is tracking that asks, when it has begun with an image.
    if (fault == Fault::kThrowInTracking) throw std::runtime_error("no more memory");
    return executor_->Waiting(lane);
  }
  void Drain(Lane lane) override { executor_->Drain(lane); }
  void Cancel() override { executor_->Cancel(); }
  void ThrowIfFailed() const override { executor_->ThrowIfFailed(); }

  Fault fault = Fault::kNone;  // of the tasks posted from now on
  std::atomic<int> done = 0;   // in the lane of mapping

 private:
  std::unique_ptr<Executor> executor_;
};

// The map is made by the sixth image, and mapping has a few keyframes after that.
constexpr int kFrames = 14;

class LifecycleTest : public ::testing::TestWithParam<RunMode> {
 protected:
  LifecycleTest() {
    auto executor = std::make_unique<FaultyExecutor>(GetParam());
    executor_ = executor.get();
    system_ = std::make_unique<SlamSystem>(SmallRoom::SmallCamera(), SmallRoom::CheapOptions(), GetParam(),
                                           std::move(executor));
  }

  FrameResult Process(int frame) { return system_->Process(room_.Stamp(frame), room_.image(frame)); }
  void Play(int frames) {
    for (int i = 0; i < frames; ++i) Process(i);
  }
  void ExpectGood(size_t frames) {
    EXPECT_GE(system_->FrameTrajectory().size(), frames);
    EXPECT_FALSE(system_->KeyframeTrajectory().empty());
    EXPECT_LE(ApeRmse(room_.room.truth(), system_->FrameTrajectory()), 0.06);
    EXPECT_THAT(system_->map().Read()->Validate(), IsEmpty());
  }

  // Plays until a mapping task's failure reaches the caller, by Process or by Finish.
  std::string PlayUntilFailure() {
    try {
      Play(kFrames);
      system_->Finish();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  }

  const SmallRoom& room_ = SmallRoom::Get();
  std::unique_ptr<SlamSystem> system_;
  FaultyExecutor* executor_;  // the system's
};

INSTANTIATE_TEST_SUITE_P(Modes, LifecycleTest, ::testing::Values(RunMode::kOffline, RunMode::kRealtime),
                         [](const auto& mode) { return std::string(Name(mode.param)); });

TEST_P(LifecycleTest, RunsAndFinishesTwice) {
  Play(kFrames);
  EXPECT_TRUE(system_->Finish().usable);
  ExpectGood(kFrames);
  EXPECT_TRUE(system_->Finish().usable);
  ExpectGood(kFrames);
  EXPECT_EQ(system_->mapping_report().times_ms.size(), static_cast<size_t>(executor_->done));
}

TEST_P(LifecycleTest, LocalisesOnlyAndThenGrowsAgain) {
  EXPECT_THROW(system_->SetLocaliseOnly(true), InputError) << "without a map";
  Play(8);
  system_->SetLocaliseOnly(true);
  const std::string map = EncodeMap(system_->camera(), *system_->map().Read());
  for (int i = 8; i < 11; ++i) EXPECT_EQ(Process(i).tracking.state, TrackingState::kTracking) << i;
  EXPECT_EQ(EncodeMap(system_->camera(), *system_->map().Read()), map);
  system_->SetLocaliseOnly(false);
  for (int i = 11; i < kFrames; ++i) Process(i);
  system_->Finish();
  EXPECT_NE(EncodeMap(system_->camera(), *system_->map().Read()), map);
  ExpectGood(kFrames);
}

TEST_P(LifecycleTest, FinishesAndStopsBeforeTheFirstImage) {
  EXPECT_FALSE(system_->Finish().usable);
  system_->Stop();
  EXPECT_FALSE(system_->Finish().usable);
  EXPECT_THAT(system_->FrameTrajectory(), IsEmpty());
}

TEST_P(LifecycleTest, StopsTwiceAndTakesNoMoreImages) {
  Play(10);
  system_->Stop();
  system_->Stop();
  EXPECT_THROW(Process(10), InternalError);
  EXPECT_FALSE(system_->Finish().usable) << "stopped";
  ExpectGood(10);
}

TEST_P(LifecycleTest, StopsWhileMappingWouldGoOnForEver) {
  if (GetParam() == RunMode::kOffline) GTEST_SKIP() << "offline, nothing runs when Stop() can be called";
  executor_->fault = FaultyExecutor::Fault::kWaitForStop;
  Play(10);
  system_->Stop();
  EXPECT_THAT(system_->map().Read()->Validate(), IsEmpty());
  EXPECT_LE(executor_->done, 1) << "what waits is dropped";
}

TEST_P(LifecycleTest, IsDestroyedWhileMappingWouldGoOnForEver) {
  if (GetParam() == RunMode::kRealtime) executor_->fault = FaultyExecutor::Fault::kWaitForStop;
  Play(10);
  system_.reset();
}

TEST_P(LifecycleTest, AfterAResetItIsAsNew) {
  Play(10);
  system_->Reset();
  EXPECT_THAT(system_->FrameTrajectory(), IsEmpty());
  EXPECT_THAT(system_->mapping_report().times_ms, IsEmpty());
  EXPECT_EQ(system_->map().Read()->keyframes().size(), 0u);
  EXPECT_EQ(Process(0).id, FrameId(0));
  EXPECT_FALSE(system_->map().Read()->PartOf(system_->frame().reference).IsValid());
  system_->Stop();
  system_->Reset();
  Play(kFrames);
  system_->Finish();
  ExpectGood(kFrames);
}

TEST_P(LifecycleTest, AnErrorInAWorkerReachesTheCallerUntilItIsReset) {
  executor_->fault = FaultyExecutor::Fault::kThrow;
  EXPECT_EQ(PlayUntilFailure(), "disk full");
  executor_->fault = FaultyExecutor::Fault::kNone;
  EXPECT_THROW(Process(kFrames - 1), std::runtime_error) << "it has not gone";
  EXPECT_THROW(system_->Finish(), std::runtime_error);
  EXPECT_FALSE(system_->FrameTrajectory().empty()) << "the results so far";

  system_->Reset();
  Play(kFrames);
  system_->Finish();
  ExpectGood(kFrames);
}

TEST_P(LifecycleTest, AnErrorInAWorkerThatNobodyAskedForIsNoHindrance) {
  executor_->fault = FaultyExecutor::Fault::kThrow;
  EXPECT_EQ(PlayUntilFailure(), "disk full");
  system_->Stop();
  EXPECT_NO_THROW(system_->Finish());
  system_.reset();
}

TEST_P(LifecycleTest, AnErrorInTrackingReachesTheCaller) {
  Play(10);
  const cv::Mat wrong_mask = cv::Mat::zeros(3, 3, CV_8UC1);
  EXPECT_THROW(system_->Process(room_.Stamp(10), room_.image(10), wrong_mask), InternalError);
  ExpectGood(10);
  EXPECT_EQ(Process(10).tracking.state, TrackingState::kTracking) << "nothing was changed";
  executor_->fault = FaultyExecutor::Fault::kThrowInTracking;
  EXPECT_THROW(Process(11), std::runtime_error);
  executor_->fault = FaultyExecutor::Fault::kNone;
  EXPECT_THROW(Process(12), std::runtime_error) << "the image before was left half done";
  EXPECT_THROW(system_->Finish(), std::runtime_error);
  ExpectGood(11);
  system_->Reset();
  Play(kFrames);
  system_->Finish();
  ExpectGood(kFrames);
}

TEST_P(LifecycleTest, AFailedRunKeepsItsResults) {
  executor_->fault = FaultyExecutor::Fault::kThrow;
  ImageSource source(room_.images);
  const RunSummary summary = RunSequence(source, *system_);
  EXPECT_EQ(FailureMessage(summary), "disk full");
  EXPECT_FALSE(summary.interrupted);
  EXPECT_GT(summary.frames.size(), 0u);
  EXPECT_EQ(summary.frames_total, summary.frames.size() + summary.frames_dropped);
  EXPECT_THROW(Process(0), InternalError) << "stopped";
}

TEST_P(LifecycleTest, AnInterruptedRunKeepsItsResults) {
  ImageSource source(room_.images);
  size_t frames = 0;
  const RunSummary summary = RunSequence(
      source, *system_,
      {[&](const RunProgress& progress) { frames = progress.frame; }, [&] { return frames >= 3; }});
  EXPECT_TRUE(summary.interrupted);
  EXPECT_EQ(summary.frames.size(), 3u);
  EXPECT_FALSE(summary.final_bundle.usable);
  EXPECT_EQ(system_->FrameTrajectory().size(), summary.frames_tracked + summary.frames_backfilled);
}

TEST_P(LifecycleTest, AnInterruptAfterTheLastImageEndsTheRunToo) {
  struct EndingSource : ImageSource {
    using ImageSource::ImageSource;
    std::optional<SourceImage> Next() override {
      std::optional<SourceImage> image = ImageSource::Next();
      if (!image.has_value()) has_ended = true;
      return image;
    }
    std::atomic<bool> has_ended = false;
  };
  EndingSource source(room_.images);
  const RunSummary summary = RunSequence(source, *system_, {{}, [&] { return source.has_ended.load(); }});
  EXPECT_TRUE(summary.interrupted);
  EXPECT_THAT(system_->map().Read()->Validate(), IsEmpty());
}

// For ThreadSanitizer above all: it sees a missing lock only where both threads are at work, so mapping has
// more to do for a keyframe than tracking has for a frame, and always a keyframe to do it for.
TEST(ThreadedTest, MappingIsBusyWhileTrackingGoesOn) {
  const SmallRoom& room = SmallRoom::Get();
  SystemOptions options = SmallRoom::CheapOptions();
  options.tracker.keyframe.max_frames = 1;
  options.mapper.triangulation_neighbours = 100;
  options.mapper.fusion_neighbours = 100;
  options.mapper.redundant_ratio = 1;
  SlamSystem system(SmallRoom::SmallCamera(), options, RunMode::kRealtime);
  Trajectory truth;
  for (int i = 0; i < 4 * SmallRoom::kFrames; ++i) {  // there and back, twice
    const int at = i % (2 * SmallRoom::kFrames);
    const int image = at < SmallRoom::kFrames ? at : 2 * SmallRoom::kFrames - 1 - at;
    truth.push_back({i / 10.0, room.room.truth()[static_cast<size_t>(image)].world_from_cam});
    system.Process(truth.back().timestamp_s, room.image(image));
  }
  system.Finish();
  EXPECT_GE(system.FrameTrajectory().size(), truth.size() * 9 / 10);
  EXPECT_LE(ApeRmse(truth, system.FrameTrajectory()), 0.06);
  EXPECT_THAT(system.map().Read()->Validate(), IsEmpty());
}

TEST(OfflineResetTest, TheSameImagesGiveTheSameBytesAgain) {
  const SmallRoom& room = SmallRoom::Get();
  SlamSystem system(SmallRoom::SmallCamera(), SmallRoom::CheapOptions());
  std::vector<Trajectory> trajectories;
  for (int run = 0; run < 2; ++run) {
    for (int i = 0; i < kFrames; ++i) system.Process(room.Stamp(i), room.image(i));
    system.Finish();
    trajectories.push_back(system.FrameTrajectory());
    system.Reset();
  }
  ASSERT_EQ(trajectories[0].size(), trajectories[1].size());
  ASSERT_GT(trajectories[0].size(), 10u);
  for (size_t i = 0; i < trajectories[0].size(); ++i) {
    EXPECT_EQ(trajectories[0][i].world_from_cam, trajectories[1][i].world_from_cam) << i;
  }
}

// Frames are counted anew, so nothing may be asked of the keyframe before the reset.
TEST(OfflineResetTest, ALoadedMapGrowsAsItDoesInANewSystem) {
  const SmallRoom& room = SmallRoom::Get();
  SlamSystem system(SmallRoom::SmallCamera(), SmallRoom::CheapOptions());
  const auto run = [&room](SlamSystem& of) {
    for (int i = 0; i < kFrames; ++i) of.Process(room.Stamp(i), room.image(i));
    of.Finish();
    return of.FrameTrajectory();
  };
  run(system);
  const std::string bytes = EncodeMap(system.camera(), *system.map().Read());
  system.Reset();
  system.LoadMap(DecodeMap(bytes, "first run"), "first run");
  const Trajectory after_reset = run(system);

  SlamSystem fresh(SmallRoom::SmallCamera(), SmallRoom::CheapOptions());
  fresh.LoadMap(DecodeMap(bytes, "first run"), "first run");
  const Trajectory in_fresh = run(fresh);

  const auto keyframes = [](const SlamSystem& of) { return of.map().Read()->keyframes().CreatedCount(); };
  EXPECT_EQ(keyframes(system), keyframes(fresh));
  ASSERT_EQ(after_reset.size(), in_fresh.size());
  ASSERT_GT(after_reset.size(), 10u);
  for (size_t i = 0; i < after_reset.size(); ++i) {
    EXPECT_EQ(after_reset[i].world_from_cam, in_fresh[i].world_from_cam) << i;
  }
}

}  // namespace
}  // namespace dynamic_slam
