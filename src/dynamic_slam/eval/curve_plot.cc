#include "dynamic_slam/eval/curve_plot.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "dynamic_slam/eval/trajectory_plot.h"

namespace dynamic_slam {
namespace {

constexpr double kTitlePx = 11, kTextPx = 8;                                // height of letters
constexpr double kTopPx = 72, kBottomPx = 40, kLeftPx = 62, kRightPx = 20;  // margins about the plot
constexpr double kHeadroom = 1.05;

double Reach(const CurvePlot& plot, int axis, double given) {
  if (given > 0) return given;
  double reach = 0;
  for (const CurvePlot::Curve& curve : plot.curves) {
    for (const Eigen::Vector2d& point : curve.points) reach = std::max(reach, point[axis]);
  }
  return reach > 0 ? kHeadroom * reach : 1;
}

std::string Tick(double value, double step) {
  const int digits = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  return fmt::format("{:.{}f}", value, digits);
}

}  // namespace

void DrawCurves(const CurvePlot& plot, const Eigen::Vector2d& top_left, double width_px, double height_px,
                Canvas* canvas) {
  const Eigen::Vector2d corner = top_left + Eigen::Vector2d(kLeftPx, kTopPx),
                        size(width_px - kLeftPx - kRightPx, height_px - kTopPx - kBottomPx),
                        end = corner + size;
  const double x_max = Reach(plot, 0, plot.x_max), y_max = Reach(plot, 1, plot.y_max);
  const auto to_px = [&](const Eigen::Vector2d& point) {
    return Eigen::Vector2d(corner.x() + size.x() * point.x() / x_max, end.y() - size.y() * point.y() / y_max);
  };
  const double x_step = GridStep(x_max), y_step = GridStep(y_max);
  constexpr double kRounding = 1 + 1e-9;
  for (int i = 0; i * x_step <= x_max * kRounding; ++i) {
    const double x_px = to_px({i * x_step, 0}).x();
    canvas->Line({x_px, corner.y()}, {x_px, end.y()}, kGridLine, 1);
    canvas->Text(Tick(i * x_step, x_step), {x_px, end.y() + 14}, kTextPx, kInk, Canvas::Align::kCentre);
  }
  for (int i = 0; i * y_step <= y_max * kRounding; ++i) {
    const double y_px = to_px({0, i * y_step}).y();
    canvas->Line({corner.x(), y_px}, {end.x(), y_px}, kGridLine, 1);
    canvas->Text(Tick(i * y_step, y_step), {corner.x() - 6, y_px + kTextPx / 2}, kTextPx, kInk,
                 Canvas::Align::kRight);
  }
  canvas->Text(plot.x_name, {corner.x() + 0.5 * size.x(), end.y() + 32}, kTextPx, kInk,
               Canvas::Align::kCentre);
  canvas->Text(plot.y_name, {corner.x(), corner.y() - 8}, kTextPx, kInk);
  for (const CurvePlot::Curve& curve : plot.curves) {
    std::vector<Eigen::Vector2d> points_px;
    for (const Eigen::Vector2d& point : curve.points) points_px.push_back(to_px(point));
    canvas->Polyline(points_px, curve.colour, curve.width_px);
  }
  canvas->Box(corner, size.x(), size.y(), kFaintInk);
  canvas->Text(plot.title, {corner.x(), top_left.y() + 20}, kTitlePx, kInk);
  Eigen::Vector2d at(corner.x(), top_left.y() + 44);
  for (const CurvePlot::Curve& curve : plot.curves) {
    canvas->Line(at + Eigen::Vector2d(0, -kTextPx / 2), at + Eigen::Vector2d(22, -kTextPx / 2), curve.colour,
                 curve.width_px);
    canvas->Text(curve.name, at + Eigen::Vector2d(29, 0), kTextPx, kInk);
    at.x() += 50 + Canvas::TextWidth(curve.name, kTextPx);
  }
}

cv::Mat DrawCurves(const CurvePlot& plot, int width_px, int height_px) {
  Canvas canvas(width_px, height_px);
  DrawCurves(plot, {0, 0}, width_px, height_px, &canvas);
  return canvas.Finish();
}

}  // namespace dynamic_slam
