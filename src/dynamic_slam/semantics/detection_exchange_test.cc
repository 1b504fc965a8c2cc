#include "dynamic_slam/semantics/detection_exchange.h"

#include <gtest/gtest.h>

#include "dynamic_slam/base/worker.h"

namespace dynamic_slam {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::minutes kLong(10);

DetectionResult ResultOf(uint32_t frame) { return {FrameId(frame), {{{1, 2, 3, 4}, 0, 0.5}}, ""}; }

TEST(IsAnswerDue, BearsStampsThatWereRounded) {
  EXPECT_FALSE(IsAnswerDue(1.5, 1.4667));
  EXPECT_TRUE(IsAnswerDue(1.5, 1.49999));
  EXPECT_TRUE(IsAnswerDue(1.5, 1.5));
}

TEST(DetectionExchangeTest, AResultIsReadOnceAndOnlyForItsFrame) {
  DetectionExchange exchange;
  EXPECT_FALSE(exchange.Read(FrameId(1), Clock::now()).has_value());
  exchange.Write(ResultOf(1));
  EXPECT_FALSE(exchange.Read(FrameId(2), Clock::now()).has_value()) << "another frame's";
  const auto result = exchange.Read(FrameId(1), Clock::now());
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->frame, FrameId(1));
  EXPECT_EQ(result->detections.size(), 1u);
  EXPECT_FALSE(exchange.Read(FrameId(1), Clock::now()).has_value()) << "read already";
}

TEST(DetectionExchangeTest, ReadingWaitsForWhatAnotherThreadWrites) {
  DetectionExchange exchange;
  Worker worker("test");
  worker.Post([&exchange](const std::stop_token&) {
    exchange.Write(ResultOf(6));
    exchange.Write(ResultOf(7));
  });
  EXPECT_TRUE(exchange.Read(FrameId(7), Clock::now() + kLong).has_value());
  EXPECT_TRUE(exchange.Read(FrameId(6), Clock::now()).has_value());
}

TEST(DetectionExchangeTest, ResultsThatNobodyReadsDoNotPileUp) {
  DetectionExchange exchange;
  for (uint32_t frame = 0; frame < 1000; ++frame) exchange.Write(ResultOf(frame));
  EXPECT_FALSE(exchange.Read(FrameId(0), Clock::now()).has_value());
  EXPECT_TRUE(exchange.Read(FrameId(999), Clock::now()).has_value());
}

}  // namespace
}  // namespace dynamic_slam
