#pragma once

#include <memory>
#include <vector>

#include "dynamic_slam/io/box_file.h"
#include "dynamic_slam/semantics/detector.h"

namespace dynamic_slam {

// Another detector, whose answers it keeps.
class RecordingDetector : public Detector {
 public:
  explicit RecordingDetector(std::shared_ptr<Detector> detector)
      : Detector(detector->name(), detector->class_names()), detector_(std::move(detector)) {}

  // In the order of the images. To be read when the run has ended.
  const std::vector<BoxRecord>& records() const { return records_; }

 private:
  std::vector<Detection> Find(const cv::Mat& image, FrameId frame, double timestamp_s) override {
    std::vector<Detection> detections = detector_->Detect(image, frame, timestamp_s);
    for (const Detection& detection : detections) {
      records_.push_back({timestamp_s, class_names()[static_cast<size_t>(detection.class_id)],
                          detection.score, 1, detection.box});
    }
    return detections;
  }

  std::shared_ptr<Detector> detector_;
  std::vector<BoxRecord> records_;
};

}  // namespace dynamic_slam
