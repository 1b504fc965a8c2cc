#include "dynamic_slam/eval/trajectory_plot.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace dynamic_slam {
namespace {

constexpr double kTitlePx = 11, kTextPx = 8;                                // height of letters
constexpr double kTopPx = 58, kBottomPx = 40, kLeftPx = 52, kRightPx = 14;  // margins about the plot
constexpr double kBorder = 0.06;      // of the extent, around what is shown
constexpr double kHiddenDots = 0.01;  // on each side

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void Include(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double Extent() const { return high - low; }
};

Range RangeAlong(const std::vector<PlotLayer>& layers, int axis) {
  Range range;
  for (const PlotLayer& layer : layers) {
    std::vector<double> values;
    for (const Eigen::Vector3d& position : layer.positions) {
      if (position.allFinite()) values.push_back(position[axis]);
    }
    if (values.empty()) continue;
    std::sort(values.begin(), values.end());
    const double share = layer.kind == PlotLayer::Kind::kDots ? kHiddenDots : 0;
    const size_t hidden = static_cast<size_t>(share * static_cast<double>(values.size()));
    range.Include(values[hidden]);
    range.Include(values[values.size() - 1 - hidden]);
  }
  if (!(range.Extent() >= 0)) return {0, 1};  // nothing to show
  return range;
}

// From metres to px, the same scale in both directions.
struct PlotFrame {
  Eigen::Vector2d corner, size;  // px, the plot without its margins
  Eigen::Vector2d centre;        // m
  double px_per_m = 1;
  std::array<int, 2> axes;

  Eigen::Vector2d ToPx(const Eigen::Vector2d& metres) const {
    const Eigen::Vector2d from_centre = px_per_m * (metres - centre);
    return corner + 0.5 * size + Eigen::Vector2d(from_centre.x(), -from_centre.y());
  }
  Eigen::Vector2d ToPx(const Eigen::Vector3d& position) const {
    return ToPx(Eigen::Vector2d(position[axes[0]], position[axes[1]]));
  }
  bool IsInside(const Eigen::Vector2d& px) const {
    return ((px - corner).array() >= 0).all() && ((corner + size - px).array() >= 0).all();
  }
};

PlotFrame MakeFrame(const TrajectoryPlot& plot, const Eigen::Vector2d& top_left, double width_px,
                    double height_px) {
  PlotFrame frame;
  frame.corner = top_left + Eigen::Vector2d(kLeftPx, kTopPx);
  frame.size = {width_px - kLeftPx - kRightPx, height_px - kTopPx - kBottomPx};
  frame.axes = plot.axes;
  const Range x = RangeAlong(plot.layers, plot.axes[0]), y = RangeAlong(plot.layers, plot.axes[1]);
  frame.centre = {0.5 * (x.low + x.high), 0.5 * (y.low + y.high)};
  const double border = 1 + 2 * kBorder;
  const double m_per_px = border * std::max({x.Extent() / frame.size.x(), y.Extent() / frame.size.y(), 1e-9});
  frame.px_per_m = 1 / m_per_px;
  return frame;
}

void DrawGrid(const PlotFrame& frame, Canvas* canvas) {
  const Eigen::Vector2d half = 0.5 * frame.size / frame.px_per_m;
  const double step = GridStep(2 * half.maxCoeff());
  const int digits = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  const Eigen::Vector2d end = frame.corner + frame.size;
  // Counted in whole steps, so that no line is lost to rounding; + 0.0 turns -0 into 0.
  for (double i = std::ceil((frame.centre.x() - half.x()) / step); i * step <= frame.centre.x() + half.x();
       ++i) {
    const double x_px = frame.ToPx(Eigen::Vector2d(i * step, 0)).x();
    canvas->Line({x_px, frame.corner.y()}, {x_px, end.y()}, kGridLine, 1);
    canvas->Text(fmt::format("{:.{}f}", i * step + 0.0, digits), {x_px, end.y() + 14}, kTextPx, kInk,
                 Canvas::Align::kCentre);
  }
  for (double i = std::ceil((frame.centre.y() - half.y()) / step); i * step <= frame.centre.y() + half.y();
       ++i) {
    const double y_px = frame.ToPx(Eigen::Vector2d(0, i * step)).y();
    canvas->Line({frame.corner.x(), y_px}, {end.x(), y_px}, kGridLine, 1);
    canvas->Text(fmt::format("{:.{}f}", i * step + 0.0, digits), {frame.corner.x() - 6, y_px + kTextPx / 2},
                 kTextPx, kInk, Canvas::Align::kRight);
  }
  constexpr const char* kAxisNames[] = {"x [m]", "y [m]", "z [m]"};
  canvas->Text(kAxisNames[frame.axes[0]], {frame.corner.x() + 0.5 * frame.size.x(), end.y() + 32}, kTextPx,
               kInk, Canvas::Align::kCentre);
  canvas->Text(kAxisNames[frame.axes[1]], {frame.corner.x() - 6, frame.corner.y() - 6}, kTextPx, kInk,
               Canvas::Align::kRight);
}

void DrawLayer(const PlotLayer& layer, const PlotFrame& frame, Canvas* canvas) {
  std::vector<Eigen::Vector2d> positions_px;
  for (const Eigen::Vector3d& position : layer.positions) positions_px.push_back(frame.ToPx(position));
  if (layer.kind == PlotLayer::Kind::kLine) {
    canvas->Polyline(positions_px, layer.colour, layer.width_px);
    return;
  }
  for (const Eigen::Vector2d& px : positions_px) {
    if (px.allFinite() && frame.IsInside(px)) canvas->Disc(px, layer.width_px, layer.colour);
  }
}

void DrawLegend(const std::vector<PlotLayer>& layers, Eigen::Vector2d position, Canvas* canvas) {
  constexpr double kSamplePx = 22, kGapPx = 7;
  for (const PlotLayer& layer : layers) {
    const Eigen::Vector2d middle = position + Eigen::Vector2d(0, -kTextPx / 2);
    if (layer.kind == PlotLayer::Kind::kLine) {
      canvas->Line(middle, middle + Eigen::Vector2d(kSamplePx, 0), layer.colour, layer.width_px);
    } else {
      canvas->Disc(middle + Eigen::Vector2d(kSamplePx / 2, 0), std::max(2.5, layer.width_px), layer.colour);
    }
    canvas->Text(layer.name, position + Eigen::Vector2d(kSamplePx + kGapPx, 0), kTextPx, kInk);
    position.x() += kSamplePx + kGapPx + Canvas::TextWidth(layer.name, kTextPx) + 3 * kGapPx;
  }
}

}  // namespace

double GridStep(double extent) {
  const double wanted = extent / 6;
  const double power = std::pow(10, std::floor(std::log10(wanted)));
  const double digit = wanted / power;
  return power * (digit < 1.5 ? 1 : digit < 3.5 ? 2 : digit < 7.5 ? 5 : 10);
}

std::vector<Eigen::Vector3d> CameraPositions(const Trajectory& trajectory, const Sim3& target_from_world) {
  std::vector<double> intervals_s;
  for (size_t i = 1; i < trajectory.size(); ++i) {
    intervals_s.push_back(trajectory[i].timestamp_s - trajectory[i - 1].timestamp_s);
  }
  std::vector<Eigen::Vector3d> positions;
  double longest_s = 0;
  if (!intervals_s.empty()) {
    std::vector<double> sorted = intervals_s;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<long>(sorted.size() / 2), sorted.end());
    longest_s = 5 * sorted[sorted.size() / 2];
  }
  for (size_t i = 0; i < trajectory.size(); ++i) {
    if (i > 0 && intervals_s[i - 1] > longest_s) {
      positions.push_back(Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    }
    positions.push_back(target_from_world * trajectory[i].world_from_cam.translation);
  }
  return positions;
}

std::array<int, 2> LargestPlane(const std::vector<Eigen::Vector3d>& positions) {
  std::array<double, 3> extents;
  const std::vector<PlotLayer> layers{{.name = "", .colour = {}, .positions = positions}};
  for (int axis = 0; axis < 3; ++axis) extents[static_cast<size_t>(axis)] = RangeAlong(layers, axis).Extent();
  const auto smallest = std::min_element(extents.rbegin(), extents.rend());  // of equal ones the last
  const int left_out = 2 - static_cast<int>(smallest - extents.rbegin());
  return {left_out == 0 ? 1 : 0, left_out == 2 ? 1 : 2};
}

void DrawPlot(const TrajectoryPlot& plot, const Eigen::Vector2d& top_left, double width_px, double height_px,
              Canvas* canvas) {
  const PlotFrame frame = MakeFrame(plot, top_left, width_px, height_px);
  DrawGrid(frame, canvas);
  for (const PlotLayer& layer : plot.layers) DrawLayer(layer, frame, canvas);
  canvas->Box(frame.corner, frame.size.x(), frame.size.y(), kFaintInk);
  canvas->Text(plot.title, {frame.corner.x(), top_left.y() + 20}, kTitlePx, kInk);
  DrawLegend(plot.layers, {frame.corner.x(), top_left.y() + 44}, canvas);
}

cv::Mat DrawPlot(const TrajectoryPlot& plot, int width_px, int height_px) {
  Canvas canvas(width_px, height_px);
  DrawPlot(plot, Eigen::Vector2d(0, 0), width_px, height_px, &canvas);
  return canvas.Finish();
}

}  // namespace dynamic_slam
