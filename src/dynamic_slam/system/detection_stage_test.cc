#include "dynamic_slam/system/detection_stage.h"

#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <thread>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kFps = 30;

Camera TestCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fps = kFps;
  camera.fx = camera.fy = 500;
  camera.cx = 320;
  camera.cy = 240;
  return camera;
}

// Says what a function says.
class FakeDetector : public Detector {
 public:
  using Answer = std::function<std::vector<Detection>(FrameId)>;

  explicit FakeDetector(Answer answer) : Detector("fake", {"person", "car"}), answer_(std::move(answer)) {}

  std::atomic<int> begun = 0;

 private:
  std::vector<Detection> Find(const cv::Mat&, FrameId frame, double) override {
    ++begun;
    return answer_(frame);
  }
  Answer answer_;
};

// A person who walks to the right by 3 px a frame.
Detection Walker(FrameId frame) { return {{100 + 3.0 * frame.value(), 100, 80, 200}, 0, 0.9}; }

class DetectionStageTest : public ::testing::Test {
 protected:
  void Make(FakeDetector::Answer answer, const DetectionOptions& options = {}) {
    detector_ = std::make_shared<FakeDetector>(std::move(answer));
    stage_.emplace(detector_, options, TestCamera(), executor_.get());
  }

  FrameObjects Process(uint32_t number) {
    const FrameId frame(number);
    const double stamp_s = number / kFps;
    if (stage_->Begin(frame, stamp_s)) stage_->Submit(frame, stamp_s, image_);
    return stage_->Collect(frame, stamp_s, std::nullopt);
  }

  std::unique_ptr<Executor> executor_ = MakeInlineExecutor();
  std::shared_ptr<FakeDetector> detector_;
  std::optional<DetectionStage> stage_;
  cv::Mat image_ = cv::Mat::zeros(480, 640, CV_8UC3);
};

TEST_F(DetectionStageTest, AnAnswerInTimeIsTheFramesOwn) {
  Make([](FrameId frame) { return std::vector<Detection>{Walker(frame)}; });
  for (uint32_t i = 0; i < 10; ++i) {
    const FrameObjects objects = Process(i);
    EXPECT_EQ(objects.state, DetectionState::kOnTime);
    ASSERT_EQ(objects.boxes.size(), 1u);
    EXPECT_TRUE(objects.boxes[0].is_detected);
    EXPECT_GT(IoU(objects.boxes[0].box, Walker(FrameId(i)).box), 0.9);
  }
  EXPECT_EQ(stage_->report().asked, 10);
  EXPECT_EQ(stage_->report().on_time, 10);
  EXPECT_EQ(stage_->report().times_ms.size(), 10u);
}

TEST_F(DetectionStageTest, BetweenTheFramesThatAreAskedAboutBoxesAreCompensated) {
  DetectionOptions options;
  options.every = 3;
  Make([](FrameId frame) { return std::vector<Detection>{Walker(frame)}; }, options);
  for (uint32_t i = 0; i < 30; ++i) {
    const FrameObjects objects = Process(i);
    EXPECT_EQ(objects.state, i % 3 == 0 ? DetectionState::kOnTime : DetectionState::kNotAsked);
    ASSERT_EQ(objects.boxes.size(), 1u) << i;
    EXPECT_EQ(objects.boxes[0].is_detected, i % 3 == 0);
    EXPECT_GT(IoU(objects.boxes[0].box, Walker(FrameId(i)).box), 0.8) << i;
  }
  EXPECT_EQ(stage_->report().asked, 10);
}

TEST_F(DetectionStageTest, WhatIsUntoldIsAwaitedForALimitedTime) {
  DetectionOptions options;
  options.latency_ms = 90;
  Make([](FrameId frame) { return std::vector<Detection>{Walker(frame)}; }, options);
  for (uint32_t i = 0; i < 10; ++i) {
    const FrameObjects objects = Process(i);
    EXPECT_EQ(objects.untold_from, FrameId(i / 3 * 3)) << "asked about every third frame: " << i;
    EXPECT_EQ(objects.told_to, i < 3 ? FrameId() : FrameId(i / 3 * 3 - 3)) << i;
  }
  stage_->Reset();
  EXPECT_EQ(Process(0).untold_from, FrameId(0));

  options.latency_ms = 60000;
  options.first_answer_s = 0.5;
  Make([](FrameId) { return std::vector<Detection>{}; }, options);
  for (uint32_t i = 0; i < 30; ++i) EXPECT_EQ(Process(i).untold_from.IsValid(), i < 0.5 * kFps) << i;
}

TEST_F(DetectionStageTest, AFailureIsAnAnswer) {
  Make([](FrameId) -> std::vector<Detection> { throw std::runtime_error("no memory"); });
  EXPECT_FALSE(Process(0).untold_from.IsValid());
}

TEST_F(DetectionStageTest, ALateAnswerTellsOnceOfTheFramesBefore) {
  DetectionOptions options;
  options.latency_ms = 90;
  // The walker is there all the time, and a second person from frame 6 on.
  Make(
      [](FrameId frame) {
        std::vector<Detection> seen{Walker(frame)};
        if (frame.value() >= 6) seen.push_back({{450, 100, 80, 200}, 0, 0.9});
        return seen;
      },
      options);
  for (uint32_t i = 0; i < 30; ++i) {
    const FrameObjects objects = Process(i);
    if (i != 3 && i != 9) {
      EXPECT_THAT(objects.late, IsEmpty()) << i;
      continue;
    }
    ASSERT_EQ(objects.late.size(), 3u) << i;
    for (uint32_t k = 0; k < 3; ++k) {
      EXPECT_EQ(objects.late[k].frame, FrameId(i - 3 + k));
      ASSERT_EQ(objects.late[k].boxes.size(), 1u) << "only whom nobody knew of";
      EXPECT_TRUE(objects.late[k].boxes[0].is_dynamic);
      EXPECT_NEAR(objects.late[k].boxes[0].box.x, i == 3 ? 100 : 450, 10);
    }
  }
}

TEST_F(DetectionStageTest, ASlowNetworkIsLateAndStillOfUse) {
  DetectionOptions options;
  options.latency_ms = 90;  // between two and three frames
  Make([](FrameId frame) { return std::vector<Detection>{Walker(frame)}; }, options);
  for (uint32_t i = 0; i < 30; ++i) {
    const FrameObjects objects = Process(i);
    EXPECT_EQ(objects.state, i % 3 == 0 ? DetectionState::kLate : DetectionState::kNotAsked) << i;
    if (i < 3) {
      EXPECT_THAT(objects.boxes, IsEmpty()) << "nothing was heard yet";
    } else {
      ASSERT_EQ(objects.boxes.size(), 1u) << i;
      EXPECT_FALSE(objects.boxes[0].is_detected);
    }
    // By now the velocity is known.
    if (i > 12) {
      EXPECT_GT(IoU(objects.boxes[0].box, Walker(FrameId(i)).box), 0.8) << i;
    }
  }
  EXPECT_EQ(stage_->report().asked, 10);
  EXPECT_EQ(stage_->report().late, 9);
  EXPECT_EQ(stage_->report().on_time, 0);
}

TEST_F(DetectionStageTest, ALatencyOfWholeFramesLastsNoLongerBecauseStampsAreRounded) {
  DetectionOptions options;
  options.latency_ms = 100;
  Make([](FrameId frame) { return std::vector<Detection>{Walker(frame)}; }, options);
  for (uint32_t i = 0; i < 30; ++i) {
    const double stamp_s = 1305031452 + std::round(1e5 * i / kFps) / 1e5;
    const bool is_asked = stage_->Begin(FrameId(i), stamp_s);
    EXPECT_EQ(is_asked, i % 3 == 0) << i;
    if (is_asked) stage_->Submit(FrameId(i), stamp_s, image_);
    stage_->Collect(FrameId(i), stamp_s, std::nullopt);
  }
}

TEST_F(DetectionStageTest, AFailureIsNamedAndTheBoxStaysForAWhile) {
  Make([](FrameId frame) {
    if (frame.value() >= 10) throw std::runtime_error("out of memory");
    return std::vector<Detection>{Walker(frame)};
  });
  for (uint32_t i = 0; i < 10; ++i) Process(i);
  const FrameObjects objects = Process(10);
  EXPECT_EQ(objects.state, DetectionState::kFailed);
  EXPECT_THAT(objects.reason, HasSubstr("out of memory"));
  ASSERT_EQ(objects.boxes.size(), 1u) << "compensated";
  EXPECT_GT(IoU(objects.boxes[0].box, Walker(FrameId(10)).box), 0.8);
  Process(11);
  EXPECT_EQ(stage_->report().failed, 2) << "it is asked again";
  EXPECT_EQ(stage_->report().last_failure, "out of memory");
}

TEST_F(DetectionStageTest, WhateverADetectorSaysTheBoxesMakeSense) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  Make([&](FrameId frame) {
    std::vector<Detection> said{{{nan, 0, 10, 10}, 0, 0.9},     {{0, 0, infinity, 10}, 0, 0.9},
                                {{0, 0, 10, 10}, 0, nan},       {{-500, -500, 100, 100}, 0, 0.9},
                                {{600, 400, 1e6, 1e6}, 1, 0.9}, {{10, 10, -5, 20}, 0, 0.9},
                                {{50, 50, 60, 60}, 77, 0.9},    {{50, 50, 60, 60}, -1, 0.9}};
    for (int i = 0; i < 10000; ++i) said.push_back({{i % 600 * 1.0, i / 25 * 1.0, 30, 30}, i % 2, 0.5});
    said.push_back(Walker(frame));
    return said;
  });
  for (uint32_t i = 0; i < 5; ++i) {
    const FrameObjects objects = Process(i);
    EXPECT_EQ(objects.state, DetectionState::kOnTime);
    EXPECT_FALSE(objects.boxes.empty());
    EXPECT_LE(objects.boxes.size(), 200u);
    for (const CompensatedBox& object : objects.boxes) {
      EXPECT_TRUE(std::isfinite(object.box.Area()) && std::isfinite(object.score));
      EXPECT_GE(object.box.x, -0.5);
      EXPECT_GE(object.box.y, -0.5);
      EXPECT_LE(object.box.x + object.box.width, 640);
      EXPECT_LE(object.box.y + object.box.height, 480);
      EXPECT_TRUE(object.class_id == 0 || object.class_id == 1);
    }
  }
}

TEST_F(DetectionStageTest, ADetectorThatHangsHoldsUpNobody) {
  executor_ = MakeThreadedExecutor();
  const auto may_end = std::make_shared<std::atomic<bool>>(false);
  Make([may_end](FrameId frame) {
    while (frame.value() >= 5 && !*may_end) std::this_thread::yield();
    return std::vector<Detection>{Walker(frame)};
  });
  for (uint32_t i = 0; i < 5; ++i) {
    Process(i);
    executor_->Drain(Lane::kDetection);
  }
  for (uint32_t i = 5; i < 100; ++i) {
    const FrameObjects objects = Process(i);
    EXPECT_EQ(objects.state, i == 5 ? DetectionState::kLate : DetectionState::kNotAsked) << i;
    if (i == 99) {
      EXPECT_THAT(objects.boxes, IsEmpty()) << "not believed for ever";
    }
  }
  EXPECT_EQ(detector_->begun, 6) << "one frame at a time";
  executor_->Cancel();
  EXPECT_EQ(Worker::AbandonedCount(), 1);
  stage_->Reset();
  *may_end = true;
  while (Worker::AbandonedCount() > 0) std::this_thread::yield();
  EXPECT_THAT(Process(0).boxes.size(), testing::Le(1u)) << "and it goes on";
  executor_->Drain(Lane::kDetection);
  EXPECT_EQ(detector_->begun, 7);
}

TEST_F(DetectionStageTest, AfterAResetNothingIsLeft) {
  DetectionOptions options;
  options.latency_ms = 50;
  Make([](FrameId frame) { return std::vector<Detection>{Walker(frame)}; }, options);
  for (uint32_t i = 0; i < 20; ++i) Process(i);
  stage_->Reset();
  EXPECT_THAT(Process(0).boxes, IsEmpty());
  EXPECT_EQ(stage_->report().asked, 1);
}

}  // namespace
}  // namespace dynamic_slam
