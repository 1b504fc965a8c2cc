#include "dynamic_slam/semantics/detector.h"

#include <utility>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/semantics/sanitise.h"

namespace dynamic_slam {

Detector::Detector(std::string name, std::vector<std::string> class_names)
    : name_(std::move(name)), class_names_(std::move(class_names)) {}

std::vector<Detection> Detector::Detect(const cv::Mat& image, FrameId frame, double timestamp_s) {
  DS_CHECK(!image.empty() && (image.type() == CV_8UC1 || image.type() == CV_8UC3), "image {} x {}, type {}",
           image.cols, image.rows, image.type());
  return Sanitise(Find(image, frame, timestamp_s), image.size(), class_names_.size());
}

}  // namespace dynamic_slam
