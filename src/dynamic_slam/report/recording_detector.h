#pragma once

#include <memory>
#include <vector>

#include "dynamic_slam/base/guarded.h"
#include "dynamic_slam/io/box_file.h"
#include "dynamic_slam/semantics/detector.h"

namespace dynamic_slam {

// Another detector, whose answers it keeps.
class RecordingDetector : public Detector {
 public:
  explicit RecordingDetector(std::shared_ptr<Detector> detector)
      : Detector(detector->name(), detector->class_names()), detector_(std::move(detector)) {}

  void SetPreparation(const BoxMapping& mapping) override { detector_->SetPreparation(mapping); }
  bool ReadsPixels() const override { return detector_->ReadsPixels(); }

  // In the order of the images, as far as it came; it may still be at work when the run has ended.
  std::vector<BoxRecord> records() const { return *records_.Read(); }

 private:
  std::vector<Detection> Find(const cv::Mat& image, FrameId frame, double timestamp_s) override {
    std::vector<Detection> detections = detector_->Detect(image, frame, timestamp_s);
    const auto records = records_.Write();
    for (const Detection& detection : detections) {
      records->push_back({timestamp_s, class_names()[static_cast<size_t>(detection.class_id)],
                          detection.score, 1, detection.box});
    }
    return detections;
  }

  std::shared_ptr<Detector> detector_;
  Guarded<std::vector<BoxRecord>> records_;
};

}  // namespace dynamic_slam
