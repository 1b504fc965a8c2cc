#include "overlay_writer.h"

#include <utility>

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include "box_picture.h"
#include "dynamic_slam/eval/canvas.h"

namespace dynamic_slam {
namespace {

// The mask (Eq. 11): dynamic boxes.
void TintMask(const std::vector<DynamicBox>& objects, cv::Mat* picture) {
  constexpr double kTint = 0.25;
  for (const DynamicBox& object : objects) {
    if (!object.is_dynamic) continue;
    const Box& box = object.box;
    const cv::Rect area =
        cv::Rect(cv::Point2d(box.x, box.y), cv::Point2d(box.x + box.width, box.y + box.height)) &
        cv::Rect({}, picture->size());
    if (area.empty()) continue;
    cv::Mat part = (*picture)(area);
    part = (1 - kTint) * part + kTint * cv::Scalar(60, 60, 230);
  }
}

// Fig. 7, 11 and 13: what the pose rests on is drawn full, in a dynamic box yellow; what is not trusted is a
// red dot, the rest a grey one.
void DrawKeypoints(const Frame& frame, cv::Mat* picture) {
  const cv::Scalar used(90, 220, 90), kept(0, 220, 255), culled(60, 60, 230), unused(150, 150, 150);
  for (size_t i = 0; i < frame.features.size(); ++i) {
    const Keypoint& keypoint = frame.features.keypoints[i];
    const cv::Point2f at(keypoint.raw_x, keypoint.raw_y);
    const bool trusted = frame.static_probability[i] >= kMinStaticProbability;
    if (frame.landmarks[i].IsValid()) {
      cv::circle(*picture, at, 3, trusted ? used : kept, cv::FILLED, cv::LINE_AA);
    } else {
      cv::circle(*picture, at, 1, trusted ? unused : culled, cv::FILLED, cv::LINE_AA);
    }
  }
}

void DrawStatus(const std::string& text, cv::Mat* picture) {
  constexpr int kHeightPx = 20;
  cv::rectangle(*picture, {0, picture->rows - kHeightPx, picture->cols, kHeightPx}, cv::Scalar::all(30),
                cv::FILLED);
  cv::putText(*picture, text, {6, picture->rows - 6}, cv::FONT_HERSHEY_SIMPLEX, 0.42, cv::Scalar::all(235), 1,
              cv::LINE_AA);
}

}  // namespace

OverlayWriter::OverlayWriter(std::filesystem::path folder, const Camera& raw_camera,
                             const ImageOptions& options, std::vector<std::string> class_names)
    : folder_(std::move(folder)), preparer_(raw_camera, options), class_names_(std::move(class_names)) {
  PrepareOutputFolder(folder_);
}

void OverlayWriter::Write(const RunProgress& progress) {
  preparer_.PrepareColour(progress.image->image, &picture_);
  TintMask(progress.result->objects.boxes, &picture_);
  for (const DynamicBox& object : progress.result->objects.boxes) {
    const std::string label =
        fmt::format("{} {:.2f}", class_names_[static_cast<size_t>(object.class_id)], object.score);
    DrawBox(object.box, label, object.is_detected ? kDetectedColour : kCompensatedColour, &picture_);
  }
  DrawKeypoints(*progress.frame_in_work, &picture_);
  const TrackingResult& tracking = progress.result->tracking;
  DrawStatus(fmt::format("frame {}  {}  {} inliers  detector {}", progress.frame - 1, Name(tracking.state),
                         tracking.inliers, Name(progress.result->objects.state)),
             &picture_);
  WritePicture((folder_ / fmt::format("{:06}.jpg", progress.frame - 1)).string(), picture_);
}

}  // namespace dynamic_slam
