// How images come to tracking: in realtime mode, from a thread of their own.

#include "dynamic_slam/system/frame_feed.h"

#include <atomic>
#include <functional>
#include <stdexcept>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "small_room.h"
#include "whole_run.h"

namespace dynamic_slam {
namespace {

// Images whose stamp, and whatever happens before, a function makes; it says nothing at the end.
class FunctionSource : public FrameSource {
 public:
  using NextStamp = std::function<std::optional<double>(size_t)>;
  FunctionSource(size_t announced, NextStamp next_stamp)
      : announced_(announced), next_stamp_(std::move(next_stamp)) {}

  std::optional<SourceImage> Next() override {
    const size_t i = delivered++;
    const std::optional<double> stamp_s = next_stamp_(i);
    if (!stamp_s.has_value()) return std::nullopt;
    const SmallRoom& room = SmallRoom::Get();
    return SourceImage{*stamp_s, room.images[i % room.images.size()], std::to_string(i)};
  }
  size_t FrameCount() const override { return announced_; }
  std::string Layout() const override { return "images"; }
  std::optional<Camera> OwnCamera() const override { return std::nullopt; }
  cv::Size ImageSize() const override { return {320, 240}; }
  const std::vector<SourceProblem>& Problems() const override { return problems_; }

  std::atomic<size_t> delivered = 0;

 private:
  size_t announced_;
  NextStamp next_stamp_;
  std::vector<SourceProblem> problems_;
};

std::vector<std::string> TakeAll(FrameFeed* feed) {
  std::vector<std::string> names;
  while (const std::optional<SourceImage> image = feed->Next()) names.push_back(image->name);
  return names;
}

RunSummary RunRealtime(FrameSource& source, const RunControl& control = {}) {
  SlamSystem system(SmallRoom::SmallCamera(), SmallRoom::CheapOptions(), RunMode::kRealtime);
  return RunSequence(source, system, control);
}

// So that all images are due at once.
std::optional<double> AtOnce(size_t i, size_t count) {
  return i < count ? std::optional<double>(1e-6 * static_cast<double>(i)) : std::nullopt;
}

TEST(DirectFeedTest, TakesEveryImage) {
  FunctionSource source(5, [](size_t i) { return AtOnce(i, 5); });
  const auto feed = MakeDirectFeed(&source);
  EXPECT_THAT(TakeAll(feed.get()), testing::ElementsAre("0", "1", "2", "3", "4"));
  EXPECT_EQ(feed->DroppedCount(), 0u);
}

TEST(RealtimeFeedTest, ASlowConsumerLosesTheOldestAndHearsOfIt) {
  constexpr size_t kCount = 60;  // more than may wait
  FunctionSource source(kCount, [](size_t i) { return AtOnce(i, kCount); });
  const auto feed = MakeRealtimeFeed(&source);
  while (source.delivered <= kCount) std::this_thread::yield();  // all images, and the end
  const std::vector<std::string> taken = TakeAll(feed.get());
  ASSERT_FALSE(taken.empty());
  ASSERT_LT(taken.size(), kCount);
  for (size_t i = 0; i < taken.size(); ++i) {
    EXPECT_EQ(taken[i], std::to_string(kCount - taken.size() + i)) << "the youngest, in order";
  }
  EXPECT_EQ(feed->DroppedCount(), kCount - taken.size());
  EXPECT_FALSE(feed->Next().has_value()) << "again";
}

TEST(RealtimeFeedTest, ASlowTrackerDropsAndCounts) {
  FunctionSource source(60, [](size_t i) { return AtOnce(i, 60); });
  const RunSummary summary = RunRealtime(source, {[&](const RunProgress&) {
                                                    while (source.delivered <= 60) std::this_thread::yield();
                                                  },
                                                  {}});
  EXPECT_GT(summary.frames_dropped, 0u);
  EXPECT_EQ(summary.frames.size() + summary.frames_dropped, 60u);
  EXPECT_EQ(summary.frames_total, 60u);
}

TEST(RealtimeFeedTest, WhatTheSourceThrowsComesAfterTheImagesBeforeIt) {
  FunctionSource source(10, [](size_t i) {
    if (i == 3) throw InputError("card", "was pulled out", "Put it back.");
    return AtOnce(i, 10);
  });
  const auto feed = MakeRealtimeFeed(&source);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(feed->Next().has_value());
  EXPECT_THROW(feed->Next(), InputError);
  EXPECT_THROW(feed->Next(), InputError) << "again";
}

TEST(RealtimeFeedTest, ARunWhoseSourceThrowsKeepsItsResults) {
  FunctionSource source(100, [](size_t i) {
    if (i == 60) throw InputError("card", "was pulled out", "Put it back.");
    return AtOnce(i, 100);
  });
  const RunSummary summary = RunRealtime(source);
  EXPECT_THAT(FailureMessage(summary), testing::HasSubstr("was pulled out"));
  EXPECT_GE(summary.frames.size(), 1u);
  EXPECT_EQ(summary.frames.size() + summary.frames_dropped, 60u);
  EXPECT_EQ(summary.frames_total, 60u) << "what came, not what was announced";
}

TEST(RealtimeFeedTest, ASourceThatEndsEarlyEndsTheRun) {
  FunctionSource source(100, [](size_t i) { return AtOnce(i, 3); });
  const RunSummary summary = RunRealtime(source);
  EXPECT_EQ(summary.failure, nullptr);
  EXPECT_EQ(summary.frames.size(), 3u);
  EXPECT_EQ(summary.frames_total, 100u) << "announced";
  FunctionSource empty(0, [](size_t) { return std::nullopt; });
  EXPECT_EQ(RunRealtime(empty).frames_total, 0u);
}

TEST(RealtimeFeedTest, IsNotWaitedForWhenTheNextImageIsFarAway) {
  // Ten thousand seconds between images: a feed that cannot be woken would take as many pauses to end.
  FunctionSource source(1000, [](size_t i) { return 1e4 * static_cast<double>(i); });
  {
    const auto feed = MakeRealtimeFeed(&source);
    EXPECT_TRUE(feed->Next().has_value());
    while (source.delivered < 2) std::this_thread::yield();  // it waits, or is about to
  }
  EXPECT_LT(source.delivered, 10u) << "woken, and not by the time";
}

TEST(RealtimeFeedTest, LongPausesAreCutShort) {
  FunctionSource source(
      2, [](size_t i) { return i < 2 ? std::optional<double>(1e4 * static_cast<double>(i)) : std::nullopt; });
  const auto feed = MakeRealtimeFeed(&source);
  EXPECT_EQ(TakeAll(feed.get()).size(), 2u) << "it ends at all";
}

TEST(RealtimeFeedTest, StampsThatStandStillOrGoBackDoNotPause) {
  FunctionSource source(
      4, [](size_t i) { return i < 4 ? std::optional<double>(i % 2 == 0 ? 1e4 : 0) : std::nullopt; });
  const RunSummary summary = RunRealtime(source);
  EXPECT_EQ(summary.failure, nullptr);
  EXPECT_EQ(summary.frames.size(), 4u);
}

TEST(RealtimeFeedTest, AStoppedRunWaitsForNoImage) {
  FunctionSource source(1000, [](size_t i) { return 1e4 * static_cast<double>(i); });
  bool stop = false;
  const RunSummary summary =
      RunRealtime(source, {[&](const RunProgress&) { stop = true; }, [&] { return stop; }});
  EXPECT_TRUE(summary.interrupted);
  EXPECT_EQ(summary.frames.size(), 1u);
}

}  // namespace
}  // namespace dynamic_slam
