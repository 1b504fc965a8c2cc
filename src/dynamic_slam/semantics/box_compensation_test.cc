#include "dynamic_slam/semantics/box_compensation.h"

#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/semantics/compensation_test_scene.h"
#include "dynamic_slam/semantics/make_compensation.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<Detection> Nonsense() {
  return {{{kNan, 0, 10, 10}, 0, 0.9},     {{0, kInfinity, 10, 10}, 0, 0.9}, {{0, 0, kInfinity, 10}, 0, 0.9},
          {{0, 0, 10, kNan}, 0, 0.9},      {{0, 0, 10, 10}, 0, kNan},        {{0, 0, 10, 10}, 0, kInfinity},
          {{0, 0, 10, 10}, 0, 1.5},        {{0, 0, 10, 10}, 0, -0.1},        {{0, 0, 0, 10}, 0, 0.9},
          {{0, 0, 10, -10}, 0, 0.9},       {{700, 0, 10, 10}, 0, 0.9},       {{-20, -20, 10, 10}, 0, 0.9},
          {{1e300, 0, 1e300, 10}, 0, 0.9}, {{0, 0, 10, 10}, -1, 0.9}};
}

TEST(UsableDetections, DropsWhatMakesNoSense) {
  EXPECT_THAT(UsableDetections(Nonsense(), TestCamera(), 0, 100, 1), IsEmpty());
}

TEST(UsableDetections, ClipsToTheImage) {
  const auto usable = UsableDetections({{{{-10, 470, 1000, 1e300}, 0, 0.9}}}, TestCamera(), 0, 100, 1);
  ASSERT_THAT(usable, SizeIs(1));
  EXPECT_EQ(usable[0].box.x, 0);
  EXPECT_EQ(usable[0].box.y, 470);
  EXPECT_EQ(usable[0].box.width, 640);
  EXPECT_EQ(usable[0].box.height, 10);
}

TEST(UsableDetections, KeepsTheBestAndNoDuplicates) {
  const std::vector<Detection> detections = {At(100, 100, kPerson, 0.5), At(102, 100, kPerson, 0.9),
                                             At(102, 100, kCar, 0.8), At(400, 100, kPerson, 0.3),
                                             At(300, 100, kPerson, 0.05)};
  const auto usable = UsableDetections(detections, TestCamera(), 0.1, 100, 0.7);
  ASSERT_THAT(usable, SizeIs(3));
  EXPECT_EQ(usable[0].score, 0.9);
  EXPECT_EQ(usable[1].class_id, kCar);
  EXPECT_EQ(usable[2].score, 0.3);
  EXPECT_THAT(UsableDetections(detections, TestCamera(), 0.1, 2, 0.7), SizeIs(2));
}

// Each method.
class AnyCompensation : public testing::TestWithParam<std::string> {
 protected:
  AnyCompensation() {
    options_.method = GetParam();
    compensation_ = MakeBoxCompensation(options_, TestCamera());
  }
  CompensationOptions options_;
  std::unique_ptr<BoxCompensation> compensation_;
};

TEST_P(AnyCompensation, PassesDetectionsOnAndDropsNonsense) {
  std::vector<Detection> detections = Nonsense();
  detections.push_back(At(100, 100));
  for (uint32_t frame = 0; frame < 5; ++frame) {
    const auto boxes = compensation_->Update({FrameId(frame), frame / 30.0, detections, std::nullopt, {}});
    ASSERT_THAT(boxes, SizeIs(1));
    EXPECT_NEAR(boxes[0].box.x, 100, 1e-9);
    EXPECT_TRUE(boxes[0].is_detected);
  }
}

TEST_P(AnyCompensation, BearsTenThousandBoxesAndStrangeStamps) {
  Random random(3);
  const std::vector<double> stamps = {0, 1, 1, 0.5, kNan, kInfinity, 2, 1e18};
  for (uint32_t frame = 0; frame < 8; ++frame) {
    std::vector<Detection> detections;
    for (int i = 0; i < 10'000; ++i) {
      detections.push_back({{random.Uniform(-100, 700), random.Uniform(-100, 500), random.Uniform(0, 300),
                             random.Uniform(0, 300)},
                            static_cast<int>(random.Index(5)),
                            random.Uniform()});
    }
    const auto boxes = compensation_->Update({FrameId(frame), stamps[frame], detections, std::nullopt, {}});
    EXPECT_LE(boxes.size(), 300u);
    for (const CompensatedBox& box : boxes) {
      EXPECT_GE(box.box.x, 0);
      EXPECT_LE(box.box.x + box.box.width, 640 + 1e-9);
      EXPECT_GE(box.box.y, 0);
      EXPECT_LE(box.box.y + box.box.height, 480 + 1e-9);
    }
  }
}

TEST_P(AnyCompensation, IsTheSameEachTime) {
  const auto run = [&] {
    const auto compensation = MakeBoxCompensation(options_, TestCamera());
    Random random(5);
    std::vector<double> numbers;
    for (uint32_t frame = 0; frame < 30; ++frame) {
      std::vector<Detection> detections;
      for (uint32_t i = random.Index(6); i > 0; --i) {
        detections.push_back(At(random.Uniform(0, 500), random.Uniform(0, 300), kPerson, random.Uniform()));
      }
      for (const auto& box : compensation->Update({FrameId(frame), frame / 30.0, detections, {}, {}})) {
        numbers.insert(numbers.end(), {box.box.x, box.box.y, box.score, double(box.track_id)});
      }
    }
    return numbers;
  };
  EXPECT_EQ(run(), run());
}

INSTANTIATE_TEST_SUITE_P(Methods, AnyCompensation, testing::Values("none", "paper", "tracker"),
                         [](const auto& test) { return test.param; });

TEST(CompensationOptions, DefaultsAreInTheirRanges) { EXPECT_NO_THROW(CheckOptions(CompensationOptions())); }

TEST(CompensationOptions, NoneShowsTheDetectionsOfTheFrameOnly) {
  CompensationOptions options;
  options.method = "none";
  const auto none = MakeBoxCompensation(options, TestCamera());
  Feed feed(none.get());
  EXPECT_THAT(feed.See({{At(100, 100), At(300, 100, kPerson, 0.39)}}), SizeIs(1));
  EXPECT_THAT(feed.See(std::nullopt), IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
