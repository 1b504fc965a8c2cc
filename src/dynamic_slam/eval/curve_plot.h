#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "dynamic_slam/eval/canvas.h"

namespace dynamic_slam {

// Curves over a common axis, from (0, 0).
struct CurvePlot {
  struct Curve {
    std::string name;  // in the legend
    cv::Scalar colour;
    std::vector<Eigen::Vector2d> points;  // one that is not finite breaks the line
    double width_px = 2;
  };

  std::string title, x_name, y_name;
  std::vector<Curve> curves;
  double x_max = 0, y_max = 0;  // 0: as far as the curves go
};

// Draws into the box of the canvas.
void DrawCurves(const CurvePlot& plot, const Eigen::Vector2d& top_left, double width_px, double height_px,
                Canvas* canvas);

// A picture of the plot alone, CV_8UC3.
cv::Mat DrawCurves(const CurvePlot& plot, int width_px, int height_px);

}  // namespace dynamic_slam
