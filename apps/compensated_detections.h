#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "dynamic_slam/semantics/image_motion.h"
#include "dynamic_slam/semantics/make_compensation.h"

namespace dynamic_slam {

// Compensation over the images of `detect`, where no SLAM knows the camera's motion: boxes follow the points
// in them. Each result comes `latency_s` after its image, by the images' stamps.
class CompensatedDetections {
 public:
  // `method` is one of CompensationOptions::kMethods; the camera gives size and frame rate only.
  CompensatedDetections(const std::string& method, const Camera& camera, double latency_s);

  // The boxes in the next image (CV_8UC1 or CV_8UC3), with what the detector says of it now or later.
  std::vector<CompensatedBox> Update(FrameId frame, double timestamp_s, const cv::Mat& image,
                                     const std::vector<Detection>& detections);

 private:
  std::unique_ptr<BoxCompensation> compensation_;
  double latency_s_;
  ImageMotion motion_;
  std::deque<DetectionSet> under_way_;  // oldest first
};

}  // namespace dynamic_slam
