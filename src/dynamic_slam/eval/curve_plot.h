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
    std::vector<Eigen::Vector2d> points;
  };

  std::string title, x_name, y_name;
  std::vector<Curve> curves;
  double x_max = 0, y_max = 0;  // 0: as far as the curves go
};

// CV_8UC3.
cv::Mat DrawCurves(const CurvePlot& plot, int width_px, int height_px);

}  // namespace dynamic_slam
