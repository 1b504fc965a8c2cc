// What detectors of all kinds have in common, and the two that need no network.

#include "dynamic_slam/semantics/detector.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/semantics/hog_detector.h"
#include "dynamic_slam/semantics/replay_detector.h"

namespace dynamic_slam {
namespace {

class FixedDetector : public Detector {
 public:
  explicit FixedDetector(std::vector<Detection> answer)
      : Detector("fixed", {"person"}), answer_(std::move(answer)) {}

 private:
  std::vector<Detection> Find(const cv::Mat&, FrameId, double) override { return answer_; }
  std::vector<Detection> answer_;
};

TEST(DetectorTest, AnswersAreSane) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  FixedDetector detector({{{kNaN, 0, 1, 1}, 0, 1}, {{-5, -5, 1000, 1000}, 0, 7}, {{0, 0, 1, 1}, 3, 1}});
  const auto found = detector.Detect(cv::Mat::zeros(48, 64, CV_8UC1), FrameId(0), 0);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].box.width, 64);
  EXPECT_EQ(found[0].box.height, 48);
  EXPECT_EQ(found[0].score, 1);
}

std::vector<double> ReplayedScores(Detector& detector, const std::vector<double>& stamps_s) {
  std::vector<double> scores;
  for (const double stamp_s : stamps_s) {
    const auto found = detector.Detect(cv::Mat::zeros(48, 64, CV_8UC3), FrameId(0), stamp_s);
    scores.push_back(found.empty() ? 0 : found[0].score);
  }
  return scores;
}

DetectionSet SetAt(double timestamp_s, double score) {
  return {FrameId(), timestamp_s, {{{1, 1, 10, 10}, 0, score}}};
}

TEST(ReplayDetectorTest, TakesTheNearestWithin10Ms) {
  const auto detector =
      MakeReplayDetector("boxes", {SetAt(1, 0.1), SetAt(2, 0.2), SetAt(3, 0.3)}, {"person"});
  EXPECT_THAT(ReplayedScores(*detector, {1, 0.991, 1.009, 2.5, 2.9999, 3.009, 3.02, 0.98, -1e9, 1e9}),
              testing::ElementsAre(0.1, 0.1, 0.1, 0, 0.3, 0.3, 0, 0, 0, 0));
}

TEST(ReplayDetectorTest, OfAFastCameraWithinHalfAFrame) {
  const auto detector = MakeReplayDetector(
      "boxes", {SetAt(0, 0.1), SetAt(0.004, 0.2), SetAt(0.008, 0.3), SetAt(0.016, 0.5)}, {"person"});
  EXPECT_THAT(ReplayedScores(*detector, {0.004, 0.0055, 0.0065, 0.012}),
              testing::ElementsAre(0.2, 0.2, 0.3, 0))
      << "the frame at 0.012 s has no boxes, and gets none of its neighbours";
}

TEST(ReplayDetectorTest, NoSetsAreNoBoxes) {
  const auto detector = MakeReplayDetector("boxes", {}, {});
  EXPECT_THAT(ReplayedScores(*detector, {0}), testing::ElementsAre(0));
}

TEST(HogDetectorTest, FindsNobodyInAnEmptyOrTinyImage) {
  const auto detector = MakeHogDetector();
  EXPECT_EQ(detector->name(), "hog");
  EXPECT_THAT(detector->class_names(), testing::ElementsAre("person"));
  EXPECT_THAT(detector->Detect(cv::Mat::zeros(240, 320, CV_8UC3), FrameId(0), 0), testing::IsEmpty());
  EXPECT_THAT(detector->Detect(cv::Mat::zeros(20, 20, CV_8UC1), FrameId(0), 0), testing::IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
