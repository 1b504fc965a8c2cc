#include "dynamic_slam/report/frame_choice.h"

#include <algorithm>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include "dynamic_slam/report/frame_picture.h"

namespace dynamic_slam {
namespace {

// A frame takes the place of another only when objects take so much more of it, as drawing takes time.
constexpr double kLarger = 1.2;
constexpr size_t kUnknownStretch = 300;  // frames, where nobody knows how many there will be

}  // namespace

FrameChoice::FrameChoice(const Camera& raw_camera, const ImageOptions& options, int stretches)
    : preparer_(raw_camera, options), stretches_(static_cast<size_t>(stretches)) {}

size_t FrameChoice::StretchOf(const RunProgress& progress) const {
  const size_t frame = progress.frame - 1;
  const size_t stretch =
      progress.frames_total > 0 ? frame * stretches_ / progress.frames_total : frame / kUnknownStretch;
  return std::min(stretch, stretches_ - 1);
}

void FrameChoice::Watch(const RunProgress& progress) {
  const size_t stretch = StretchOf(progress);
  double area_px = 0;
  for (const DynamicBox& box : progress.result->objects.boxes) {
    if (box.is_dynamic) area_px += box.box.Area();
  }
  const bool is_first = now_.picture.empty(), is_new = stretch != stretch_;
  if (!is_first && !is_new && area_px <= kLarger * most_area_px_) return;
  if (!is_first && is_new) past_.push_back(Pack(now_));
  stretch_ = stretch;
  most_area_px_ = area_px;
  preparer_.PrepareColour(progress.image->image, &now_.picture);
  DrawFrame(progress, &now_.picture);
  const TrackingResult& tracking = progress.result->tracking;
  now_.caption = fmt::format("frame {}: {}, {} of {} points in dynamic boxes", progress.frame - 1,
                             Name(tracking.state), tracking.dynamic.InBoxes(), tracking.keypoints);
}

FrameChoice::Packed FrameChoice::Pack(const ChosenFrame& frame) {
  constexpr int kQualityPercent = 95;
  Packed packed{{}, frame.caption};
  cv::imencode(".jpg", frame.picture, packed.jpeg, {cv::IMWRITE_JPEG_QUALITY, kQualityPercent});
  packed.jpeg.shrink_to_fit();
  return packed;
}

std::vector<ChosenFrame> FrameChoice::Frames() const {
  std::vector<ChosenFrame> frames;
  for (const Packed& packed : past_)
    frames.push_back({cv::imdecode(packed.jpeg, cv::IMREAD_COLOR), packed.caption});
  if (!now_.picture.empty()) frames.push_back(now_);
  return frames;
}

}  // namespace dynamic_slam
