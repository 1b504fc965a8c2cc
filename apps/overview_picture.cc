#include "overview_picture.h"

#include <algorithm>
#include <vector>

#include <fmt/core.h>

namespace dynamic_slam {
namespace {

constexpr int kColumns = 2, kRows = 3;
constexpr double kMarginPx = 16, kGapPx = 8;
constexpr double kTitlePx = 13, kTextPx = 8;
constexpr double kTopPx = 76;
constexpr double kImageWidthPx = 268, kCaptionPx = 20;
constexpr double kPlotWidthPx = 690;

const cv::Scalar kWithLandmark(70, 220, 90);  // green
const cv::Scalar kWithout(60, 140, 255);      // orange

// As many as the sheet has places, evenly over all.
std::vector<const Keyframe*> ChooseKeyframes(const Map& map) {
  std::vector<const Keyframe*> all, chosen;
  map.keyframes().ForEach([&all](const Keyframe& keyframe) { all.push_back(&keyframe); });
  const size_t count = std::min<size_t>(all.size(), kColumns * kRows);
  for (size_t i = 0; i < count; ++i)
    chosen.push_back(all[count == 1 ? 0 : i * (all.size() - 1) / (count - 1)]);
  return chosen;
}

void DrawKeyframe(const Keyframe& keyframe, const cv::Mat& image, const Eigen::Vector2d& top_left,
                  Canvas* canvas) {
  const double scale = kImageWidthPx / image.cols;
  canvas->Image(image, top_left, kImageWidthPx, scale * image.rows);
  for (uint32_t i = 0; i < keyframe.features().size(); ++i) {
    const Keypoint& keypoint = keyframe.keypoint(i);
    const Eigen::Vector2d at = top_left + scale * Eigen::Vector2d(keypoint.raw_x + 0.5, keypoint.raw_y + 0.5);
    if (keyframe.landmarks()[i].IsValid()) {
      canvas->Circle(at, 1.6, kWithLandmark, 0.7);
    } else {
      canvas->Disc(at, 0.7, kWithout);
    }
  }
  canvas->Text(fmt::format("frame {}: {} of {} keypoints mapped", keyframe.frame_id().value(),
                           keyframe.LandmarkCount(), keyframe.features().size()),
               top_left + Eigen::Vector2d(0, scale * image.rows + 14), kTextPx, kInk);
}

void DrawSheetLegend(const Eigen::Vector2d& position, Canvas* canvas) {
  const Eigen::Vector2d half(0, kTextPx / 2);
  canvas->Circle(position + Eigen::Vector2d(4, 0) - half, 3, kWithLandmark, 1.5);
  canvas->Text("keypoint with a landmark", position + Eigen::Vector2d(14, 0), kTextPx, kInk);
  canvas->Disc(position + Eigen::Vector2d(220, 0) - half, 2, kWithout);
  canvas->Text("without", position + Eigen::Vector2d(230, 0), kTextPx, kInk);
}

}  // namespace

cv::Mat DrawOverview(const std::string& title, const Map& map,
                     const std::function<cv::Mat(FrameId)>& image_of, const TruthComparison& comparison,
                     const Trajectory& estimate) {
  const std::vector<const Keyframe*> keyframes = ChooseKeyframes(map);
  std::vector<cv::Mat> images;
  for (const Keyframe* keyframe : keyframes) images.push_back(image_of(keyframe->frame_id()));
  const double image_height_px = kImageWidthPx * images.front().rows / images.front().cols;
  const double sheet_width_px = kColumns * kImageWidthPx + (kColumns - 1) * kGapPx;
  const double sheet_height_px = kRows * (image_height_px + kCaptionPx + kGapPx);

  Canvas canvas(static_cast<int>(kMarginPx + sheet_width_px + kGapPx + kPlotWidthPx + kMarginPx),
                static_cast<int>(kTopPx + sheet_height_px + kMarginPx));
  canvas.Text(title, {kMarginPx, 32}, kTitlePx, kInk);
  DrawSheetLegend({kMarginPx, 62}, &canvas);
  for (size_t i = 0; i < keyframes.size(); ++i) {
    const Eigen::Vector2d place(static_cast<double>(i % kColumns), static_cast<double>(i / kColumns));
    const Eigen::Vector2d pitch(kImageWidthPx + kGapPx, image_height_px + kCaptionPx + kGapPx);
    DrawKeyframe(*keyframes[i], images[i], Eigen::Vector2d(kMarginPx, kTopPx) + place.cwiseProduct(pitch),
                 &canvas);
  }

  TrajectoryPlot plot = PlotOverTruth(comparison, estimate);
  plot.axes = {0, 1};  // from above
  PlotLayer landmarks{.name = "landmarks",
                      .kind = PlotLayer::Kind::kDots,
                      .colour = kLandmarkColour,
                      .width_px = 1,
                      .positions = {}};
  map.landmarks().ForEach([&](const Landmark& landmark) {
    landmarks.positions.push_back(comparison.ape.reference_from_estimate * landmark.position());
  });
  plot.layers.insert(plot.layers.begin(), std::move(landmarks));
  const double plot_top_px = 18;
  DrawPlot(plot, {kMarginPx + sheet_width_px + kGapPx, plot_top_px}, kPlotWidthPx,
           canvas.height() - plot_top_px - 4, &canvas);
  return canvas.Finish();
}

}  // namespace dynamic_slam
