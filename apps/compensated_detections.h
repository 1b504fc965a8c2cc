#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/semantics/image_motion.h"
#include "dynamic_slam/semantics/make_compensation.h"

namespace dynamic_slam {

// Compensation over the images of `detect`, where no SLAM knows the camera's motion: boxes follow the points
// in them. A slow detector is asked as in `run` (system/detection_stage.h): about one image at a time, its
// answer comes `latency_s` after the image by the stamps, and the next image then is the next that it is
// asked about.
class CompensatedDetections {
 public:
  // `method` is one of CompensationOptions::kMethods; the camera gives size and frame rate only.
  CompensatedDetections(const std::string& method, const Camera& camera, double latency_s);

  // The boxes in the next image (CV_8UC1 or CV_8UC3), with what the detector says of it, if it is asked.
  std::vector<CompensatedBox> Update(FrameId frame, double timestamp_s, const cv::Mat& image,
                                     const std::vector<Detection>& detections);

 private:
  std::unique_ptr<BoxCompensation> compensation_;
  double latency_s_;
  ImageMotion motion_;
  std::optional<DetectionSet> open_;  // asked about, the answer is not due yet
};

}  // namespace dynamic_slam
