#include "dynamic_slam/eval/trajectory_plot.h"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

using testing::ElementsAre;

Trajectory Along(const std::vector<double>& stamps_s, const Eigen::Vector3d& velocity) {
  Trajectory trajectory;
  for (const double stamp_s : stamps_s) {
    trajectory.push_back({stamp_s, Rigid3(Eigen::Quaterniond::Identity(), stamp_s * velocity)});
  }
  return trajectory;
}

int CountColour(const cv::Mat& picture, const cv::Scalar& colour) {
  cv::Mat found;
  cv::inRange(picture, colour, colour, found);
  return cv::countNonZero(found);
}

TEST(TrajectoryPlotTest, GridStepIsOneTwoOrFive) {
  EXPECT_DOUBLE_EQ(GridStep(6), 1);
  EXPECT_DOUBLE_EQ(GridStep(10), 2);
  EXPECT_DOUBLE_EQ(GridStep(30), 5);
  EXPECT_DOUBLE_EQ(GridStep(50), 10);
  EXPECT_NEAR(GridStep(0.1), 0.02, 1e-12);
}

TEST(TrajectoryPlotTest, LargestPlaneLeavesOutTheShortestAxis) {
  EXPECT_THAT(LargestPlane({{0, 0, 0}, {3, 2, 1}}), ElementsAre(0, 1));
  EXPECT_THAT(LargestPlane({{0, 0, 0}, {3, 1, 2}}), ElementsAre(0, 2));
  EXPECT_THAT(LargestPlane({{0, 0, 0}, {1, 2, 3}}), ElementsAre(1, 2));
  EXPECT_THAT(LargestPlane({{0, 0, 0}}), ElementsAre(0, 1));
}

TEST(TrajectoryPlotTest, PausesBreakTheLine) {
  const auto positions = CameraPositions(Along({0, 1, 2, 9, 10}, {1, 0, 0}), Sim3{.scale = 2});
  ASSERT_EQ(positions.size(), 6u);
  EXPECT_FALSE(positions[3].allFinite());
  EXPECT_EQ(positions[4], Eigen::Vector3d(18, 0, 0));
  EXPECT_TRUE(CameraPositions({}).empty());
}

TEST(TrajectoryPlotTest, DrawsWhatItIsGiven) {
  TrajectoryPlot plot;
  plot.title = "title";
  EXPECT_EQ(CountColour(DrawPlot(plot, 300, 200), kEstimateColour), 0) << "nothing to draw is no error";
  plot.layers.push_back(
      {.name = "line", .colour = kEstimateColour, .width_px = 3, .positions = {{0, 0, 0}, {1, 1, 0}}});
  const cv::Mat picture = DrawPlot(plot, 300, 200);
  EXPECT_EQ(picture.size(), cv::Size(300, 200));
  EXPECT_GT(CountColour(picture, kEstimateColour), 100);
}

TEST(TrajectoryPlotTest, AFarDotDoesNotShrinkTheRest) {
  TrajectoryPlot plot;
  std::vector<Eigen::Vector3d> dots;
  for (int i = 0; i <= 200; ++i) dots.emplace_back(0.01 * i, std::sin(0.05 * i), 0);
  plot.layers.push_back({.name = "dots",
                         .kind = PlotLayer::Kind::kDots,
                         .colour = kEstimateColour,
                         .width_px = 2,
                         .positions = dots});
  const int without = CountColour(DrawPlot(plot, 300, 200), kEstimateColour);
  plot.layers[0].positions.emplace_back(1e6, 1e6, 0);
  EXPECT_GT(CountColour(DrawPlot(plot, 300, 200), kEstimateColour), 0.8 * without);
}

TEST(TrajectoryPlotTest, AFileThatCannotBeWrittenIsNamed) {
  try {
    WritePicture("/nowhere/picture.png", cv::Mat(4, 4, CV_8UC3));
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("/nowhere/picture.png"));
  }
}

}  // namespace
}  // namespace dynamic_slam
