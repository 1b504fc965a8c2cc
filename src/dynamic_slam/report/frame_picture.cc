#include "dynamic_slam/report/frame_picture.h"

#include <fmt/core.h>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/report/box_picture.h"
#include "dynamic_slam/semantics/selective_tracking.h"

namespace dynamic_slam {
namespace {

void ShadeMask(const std::vector<DynamicBox>& objects, cv::Mat* picture) {
  std::vector<Box> boxes;
  for (const DynamicBox& object : objects) {
    if (object.is_dynamic) boxes.push_back(object.box);
  }
  constexpr double kShare = 0.22;
  cv::Mat shaded;
  cv::addWeighted(*picture, 1 - kShare, cv::Mat(picture->size(), CV_8UC3, kUntrustedColour), kShare, 0,
                  shaded);
  shaded.copyTo(*picture, DynamicMask(boxes, picture->cols, picture->rows));
}

void DrawKeypoints(const Frame& frame, cv::Mat* picture) {
  const cv::Scalar unused(150, 150, 150);
  for (size_t i = 0; i < frame.features.size(); ++i) {
    const Keypoint& keypoint = frame.features.keypoints[i];
    const cv::Point2f at(keypoint.raw_x, keypoint.raw_y);
    const bool trusted = frame.static_probability[i] >= kMinStaticProbability;
    if (frame.landmarks[i].IsValid()) {
      cv::circle(*picture, at, 3, trusted ? kHoldingColour : kHoldingInBoxColour, cv::FILLED, cv::LINE_AA);
    } else {
      cv::circle(*picture, at, 1, trusted ? unused : kUntrustedColour, cv::FILLED, cv::LINE_AA);
    }
  }
}

}  // namespace

void DrawFrame(const RunProgress& progress, cv::Mat* picture) {
  const std::vector<DynamicBox>& objects = progress.result->objects.boxes;
  ShadeMask(objects, picture);
  for (const DynamicBox& object : objects) {
    const std::string label = fmt::format(
        "{} {:.2f}", progress.detector->class_names()[static_cast<size_t>(object.class_id)], object.score);
    DrawBox(object.box, label, object.is_detected ? kDetectedColour : kCompensatedColour, picture);
  }
  DrawKeypoints(*progress.frame_in_work, picture);
}

}  // namespace dynamic_slam
