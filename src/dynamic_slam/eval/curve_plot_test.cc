#include "dynamic_slam/eval/curve_plot.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace dynamic_slam {
namespace {

const cv::Scalar kRed(0, 0, 255);

// The box around what is red, below the legend.
cv::Rect RedBox(const cv::Mat& picture) {
  cv::Mat red;
  cv::inRange(picture, cv::Scalar(0, 0, 200), cv::Scalar(80, 80, 255), red);
  red.rowRange(0, 60).setTo(0);
  std::vector<cv::Point> points;
  cv::findNonZero(red, points);
  return points.empty() ? cv::Rect() : cv::boundingRect(points);
}

TEST(CurvePlotTest, CurvesAreWhereTheirPointsAre) {
  CurvePlot plot{"title", "x", "y", {{"a", kRed, {{0, 0.5}, {1, 0.5}}}}, 2, 1};
  const cv::Rect flat = RedBox(DrawCurves(plot, 600, 400));
  EXPECT_NEAR(flat.width, 0.5 * (600 - 62 - 20), 4);
  EXPECT_LE(flat.height, 4);
  plot.curves[0].points = {{0, 1}, {1, 1}};
  const cv::Rect higher = RedBox(DrawCurves(plot, 600, 400));
  EXPECT_NEAR(flat.y - higher.y, 0.5 * (400 - 72 - 40), 3);
}

TEST(CurvePlotTest, AxesReachAsFarAsTheCurves) {
  const CurvePlot plot{"title", "x", "y", {{"a", kRed, {{0, 30}, {5000, 200}}}}};
  const cv::Rect box = RedBox(DrawCurves(plot, 600, 400));
  EXPECT_GT(box.width, 480);
  EXPECT_LE(box.x + box.width, 600 - 20 + 2);
  EXPECT_GE(box.y, 72 - 2);
}

TEST(CurvePlotTest, NothingToShowIsNoError) { EXPECT_FALSE(DrawCurves({}, 300, 200).empty()); }

}  // namespace
}  // namespace dynamic_slam
