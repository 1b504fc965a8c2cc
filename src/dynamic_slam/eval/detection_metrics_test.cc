#include "dynamic_slam/eval/detection_metrics.h"

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

BoxRecord Truth(double timestamp_s, double x, double visible = 1) {
  return {timestamp_s, "person", 1, visible, {x, 0, 100, 100}};
}

BoxRecord Found(double timestamp_s, double x, double score = 0.9) {
  return {timestamp_s, "person", score, 1, {x, 0, 100, 100}};
}

TEST(DetectionMetrics, CountsByHand) {
  // Frame 0: both found. Frame 1: one missed. Frame 2: missed, and a false alarm. Frame 3: a false alarm
  // only.
  const std::vector<BoxRecord> truth = {Truth(0, 0), Truth(0, 200), Truth(1, 0), Truth(1, 200), Truth(2, 0)};
  const std::vector<BoxRecord> found = {Found(0, 10), Found(0, 190), Found(1, 0), Found(2, 60), Found(3, 0)};
  const DetectionMetrics metrics = CompareBoxes(truth, found, {});
  EXPECT_EQ(metrics.hits, 3u);
  EXPECT_EQ(metrics.misses, 2u);
  EXPECT_EQ(metrics.false_alarms, 2u);
  EXPECT_DOUBLE_EQ(metrics.Recall(), 0.6);
  EXPECT_DOUBLE_EQ(metrics.MissRate(), 0.4);
  EXPECT_DOUBLE_EQ(metrics.Precision(), 0.6);
  EXPECT_EQ(metrics.frames, 3u);
  EXPECT_DOUBLE_EQ(metrics.FrameRecall(), 2 / 3.0);
  EXPECT_DOUBLE_EQ(metrics.CompleteFrameRecall(), 1 / 3.0);
}

TEST(DetectionMetrics, OneToOneBestScoreFirst) {
  const std::vector<BoxRecord> truth = {Truth(0, 0), Truth(0, 40)};
  // Shifted by 20, a box overlaps both with 2/3; the better score takes one, the next the other.
  DetectionMetrics metrics = CompareBoxes(truth, std::vector{Found(0, 20, 0.9), Found(0, 20, 0.8)}, {});
  EXPECT_EQ(metrics.hits, 2u);
  metrics = CompareBoxes(truth, std::vector{Found(0, 0), Found(0, 1, 0.5), Found(0, 2, 0.4)}, {});
  EXPECT_EQ(metrics.hits, 1u);
  EXPECT_EQ(metrics.misses, 1u);
  EXPECT_EQ(metrics.false_alarms, 2u);
}

TEST(DetectionMetrics, HardlyVisibleTruthIsNeitherHitNorMiss) {
  const std::vector<BoxRecord> truth = {Truth(0, 0, 0.49), Truth(0, 300, 0.5)};
  const DetectionMetrics metrics =
      CompareBoxes(truth, std::vector{Found(0, 0), Found(0, 300), Found(0, 1, 0.5)}, {});
  EXPECT_EQ(metrics.hits, 1u);
  EXPECT_EQ(metrics.misses, 0u);
  EXPECT_EQ(metrics.ignored, 1u);
  EXPECT_EQ(metrics.false_alarms, 1u);  // the second box on the same truth
}

TEST(DetectionMetrics, AFoundBoxTakesTheTruthThatItFitsBestVisibleOrNot) {
  const std::vector<BoxRecord> truth = {Truth(0, 10, 0.1), Truth(0, 0)};
  DetectionMetrics metrics = CompareBoxes(truth, std::vector{Found(0, 10)}, {});
  EXPECT_EQ(metrics.hits, 0u);
  EXPECT_EQ(metrics.misses, 1u);
  EXPECT_EQ(metrics.ignored, 1u);
  EXPECT_EQ(metrics.false_alarms, 0u);
  EXPECT_EQ(metrics.frames, 1u);
  EXPECT_EQ(metrics.frames_hit, 0u);
  // Taken once, it leaves the other one to the next box.
  metrics = CompareBoxes(truth, std::vector{Found(0, 10), Found(0, 9, 0.5)}, {});
  EXPECT_EQ(metrics.hits, 1u);
  EXPECT_EQ(metrics.ignored, 1u);
}

TEST(DetectionMetrics, OtherClassesAndLowScoresAreNotLookedAt) {
  std::vector<BoxRecord> found = {Found(0, 0, 0.3), Found(0, 0)};
  found[1].class_name = "cat";
  DetectionMetricsOptions options;
  options.min_score = 0.4;
  DetectionMetrics metrics = CompareBoxes(std::vector{Truth(0, 0)}, found, options);
  EXPECT_EQ(metrics.hits + metrics.false_alarms, 0u);
  EXPECT_EQ(metrics.misses, 1u);
  options.class_name = "";  // all classes, each with its own
  metrics = CompareBoxes(std::vector{Truth(0, 0)}, found, options);
  EXPECT_EQ(metrics.misses, 1u);
  EXPECT_EQ(metrics.false_alarms, 1u);
}

TEST(DetectionMetrics, NothingToFindAndNothingFound) {
  const DetectionMetrics metrics = CompareBoxes({}, {}, {});
  EXPECT_EQ(metrics.Recall(), 1);
  EXPECT_EQ(metrics.Precision(), 1);
  EXPECT_EQ(metrics.FrameRecall(), 1);
}

TEST(DetectionMetrics, StampsAgreeToTheMicrosecond) {
  const std::vector<BoxRecord> truth = {Truth(1305031452.791720, 0)};
  EXPECT_EQ(CompareBoxes(truth, std::vector{Found(1305031452.7917202, 0)}, {}).hits, 1u);
  EXPECT_EQ(CompareBoxes(truth, std::vector{Found(1305031452.79173, 0)}, {}).hits, 0u);
}

}  // namespace
}  // namespace dynamic_slam
