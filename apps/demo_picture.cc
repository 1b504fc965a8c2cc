#include "demo_picture.h"

#include <algorithm>

#include <fmt/core.h>

#include "dynamic_slam/report/box_picture.h"
#include "dynamic_slam/report/frame_picture.h"

namespace dynamic_slam {
namespace {

constexpr int kColumns = 2;
constexpr size_t kFrames = 4;
constexpr double kMarginPx = 16, kGapPx = 8;
constexpr double kTitlePx = 12, kTextPx = 8;
constexpr double kTitleHeightPx = 40, kCaptionPx = 20, kLegendPx = 40;
constexpr double kImageWidthPx = 330, kPlotWidthPx = 620;

// A few of the run with semantics, from all of its length.
std::vector<ChosenFrame> FramesOf(const DemoScene& scene) {
  const std::vector<ChosenFrame>& all = scene.with.record.frames;
  const size_t stride = std::max<size_t>(1, all.size() / kFrames);
  std::vector<ChosenFrame> frames;
  for (size_t i = 0; i < all.size() && frames.size() < kFrames; i += stride) frames.push_back(all[i]);
  return frames;
}

double RowHeight(const std::vector<ChosenFrame>& frames) {
  if (frames.empty()) return 0;
  const cv::Mat& picture = frames.front().picture;
  return kImageWidthPx * picture.rows / picture.cols + kCaptionPx + kGapPx;
}

double SceneHeight(const DemoScene& scene) {
  const std::vector<ChosenFrame> frames = FramesOf(scene);
  const size_t rows = (frames.size() + kColumns - 1) / kColumns;
  return kTitleHeightPx + std::max(static_cast<double>(rows) * RowHeight(frames), 320.0) + kGapPx;
}

void DrawScene(const DemoScene& scene, double top, Canvas* canvas) {
  canvas->Text(fmt::format("{}: the error is {} of the path, without semantics {}", scene.name,
                           Percent(scene.with.ErrorShare()), Percent(scene.without.ErrorShare())),
               {kMarginPx, top + kTitleHeightPx - 16}, kTitlePx, kInk);
  const std::vector<ChosenFrame> frames = FramesOf(scene);
  for (size_t i = 0; i < frames.size(); ++i) {
    const Eigen::Vector2d place(static_cast<double>(i % kColumns), static_cast<double>(i / kColumns));
    const Eigen::Vector2d corner =
        Eigen::Vector2d(kMarginPx, top + kTitleHeightPx) +
        place.cwiseProduct(Eigen::Vector2d(kImageWidthPx + kGapPx, RowHeight(frames)));
    const double height = RowHeight(frames) - kCaptionPx - kGapPx;
    canvas->Image(frames[i].picture, corner, kImageWidthPx, height);
    const double caption_px = Canvas::TextWidth(frames[i].caption, kTextPx);
    canvas->Text(frames[i].caption, corner + Eigen::Vector2d(0, height + 14),
                 kTextPx * std::min(1.0, kImageWidthPx / caption_px), kInk);
  }
  if (scene.truth.empty()) return;
  TrajectoryPlot plot = PlotBoth(scene.truth, scene.with, scene.without);
  plot.axes = {0, 1};  // from above
  DrawPlot(plot, {kMarginPx + kColumns * (kImageWidthPx + kGapPx), top}, kPlotWidthPx,
           SceneHeight(scene) - kGapPx, canvas);
}

void DrawLegend(const Eigen::Vector2d& position, Canvas* canvas) {
  struct Entry {
    const char* text;
    cv::Scalar colour;
    bool is_box;
  };
  const Entry entries[] = {{"detected", kDetectedColour, true},
                           {"compensated", kCompensatedColour, true},
                           {"holds the pose", kHoldingColour, false},
                           {"holds it in a box", kHoldingInBoxColour, false},
                           {"not trusted", kUntrustedColour, false}};
  Eigen::Vector2d at = position;
  for (const Entry& entry : entries) {
    if (entry.is_box) {
      canvas->Box(at + Eigen::Vector2d(0, -9), 12, 10, entry.colour);
    } else {
      canvas->Disc(at + Eigen::Vector2d(6, -4), 3.5, entry.colour);
    }
    canvas->Text(entry.text, at + Eigen::Vector2d(18, 0), kTextPx, kInk);
    at.x() += 18 + Canvas::TextWidth(entry.text, kTextPx) + 22;
  }
}

}  // namespace

cv::Mat DrawDemo(const std::vector<DemoScene>& scenes) {
  double height = kMarginPx + kLegendPx;
  for (const DemoScene& scene : scenes) height += SceneHeight(scene);
  Canvas canvas(static_cast<int>(2 * kMarginPx + kColumns * (kImageWidthPx + kGapPx) + kPlotWidthPx),
                static_cast<int>(height));
  double top = kMarginPx;
  for (const DemoScene& scene : scenes) {
    DrawScene(scene, top, &canvas);
    top += SceneHeight(scene);
  }
  DrawLegend({kMarginPx, top + kLegendPx / 2}, &canvas);
  return canvas.Finish();
}

}  // namespace dynamic_slam
