#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "dynamic_slam/eval/canvas.h"
#include "dynamic_slam/geometry/sim3.h"
#include "dynamic_slam/geometry/trajectory.h"

namespace dynamic_slam {

struct PlotLayer {
  enum class Kind { kLine, kDots };
  std::string name;  // in the legend
  Kind kind = Kind::kLine;
  cv::Scalar colour;
  double width_px = 1.5;                   // of the line, or radius of the dots
  std::vector<Eigen::Vector3d> positions;  // m; one that is not finite breaks the line
};

// Positions in a plane, to scale, with a grid in metres. Layers are drawn in order; the picture holds all
// lines and all dots but the outermost hundredth, which is where gross errors are.
struct TrajectoryPlot {
  std::string title;
  std::vector<PlotLayer> layers;
  std::array<int, 2> axes = {0, 1};  // to the right and upwards: 0 is x, 1 is y, 2 is z
};

// The positions of the cameras after the transform. A pause of more than five times the median interval
// breaks the line.
std::vector<Eigen::Vector3d> CameraPositions(const Trajectory& trajectory,
                                             const Sim3& target_from_world = {});

// The two axes along which the positions extend most.
std::array<int, 2> LargestPlane(const std::vector<Eigen::Vector3d>& positions);

// Draws into the box of the canvas.
void DrawPlot(const TrajectoryPlot& plot, const Eigen::Vector2d& top_left, double width_px, double height_px,
              Canvas* canvas);

// A picture of the plot alone, CV_8UC3.
cv::Mat DrawPlot(const TrajectoryPlot& plot, int width_px, int height_px);

// Distance of the grid's lines: 1, 2 or 5 times a power of ten, so that about six fit into the extent (> 0).
double GridStep(double extent);

}  // namespace dynamic_slam
