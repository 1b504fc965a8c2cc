#include "overlay_writer.h"

#include <utility>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/eval/canvas.h"
#include "dynamic_slam/report/frame_picture.h"

namespace dynamic_slam {
namespace {

void DrawStatus(const std::string& text, cv::Mat* picture) {
  constexpr int kHeightPx = 20;
  cv::rectangle(*picture, {0, picture->rows - kHeightPx, picture->cols, kHeightPx}, cv::Scalar::all(30),
                cv::FILLED);
  cv::putText(*picture, text, {6, picture->rows - 6}, cv::FONT_HERSHEY_SIMPLEX, 0.42, cv::Scalar::all(235), 1,
              cv::LINE_AA);
}

}  // namespace

OverlayWriter::OverlayWriter(std::filesystem::path folder, const Camera& raw_camera,
                             const ImageOptions& options)
    : folder_(std::move(folder)), preparer_(raw_camera, options) {
  PrepareOutputFolder(folder_);
}

void OverlayWriter::Write(const RunProgress& progress) {
  preparer_.PrepareColour(progress.image->image, &picture_);
  DrawFrame(progress, &picture_);
  const TrackingResult& tracking = progress.result->tracking;
  DrawStatus(fmt::format("frame {}  {}  {} inliers  detector {}", progress.frame - 1, Name(tracking.state),
                         tracking.inliers, Name(progress.result->objects.state)),
             &picture_);
  WritePicture((folder_ / fmt::format("{:06}.jpg", progress.frame - 1)).string(), picture_);
}

}  // namespace dynamic_slam
