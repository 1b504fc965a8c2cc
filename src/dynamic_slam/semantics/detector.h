#pragma once

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/semantics/box_mapping.h"
#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// Finds objects in images, one image at a time.
class Detector {
 public:
  virtual ~Detector() = default;

  // The objects in an image, CV_8UC1 or CV_8UC3 (BGR); boxes are px of it. Whatever the detector does, what
  // it says is as Sanitise leaves it. A detector that reads its answers looks them up by the stamp. Throws
  // what the detector throws.
  std::vector<Detection> Detect(const cv::Mat& image, FrameId frame, double timestamp_s);

  // How images are prepared for it, for detectors that know boxes of the camera's own images. To be called
  // before the first image.
  virtual void SetPreparation(const BoxMapping&) {}

  // Whether its answers depend on the pixels. Else any image of the right size will do, and its pixels may
  // change meanwhile.
  virtual bool ReadsPixels() const { return true; }

  // As it was asked for: "hog", the name of a detector file, "boxes".
  const std::string& name() const { return name_; }

  // Of Detection::class_id.
  const std::vector<std::string>& class_names() const { return class_names_; }

  // What the user should know but need not change: a file that is not the one expected.
  const std::vector<std::string>& warnings() const { return warnings_; }

 protected:
  Detector(std::string name, std::vector<std::string> class_names);

  void AddWarning(std::string text) { warnings_.push_back(std::move(text)); }

 private:
  virtual std::vector<Detection> Find(const cv::Mat& image, FrameId frame, double timestamp_s) = 0;

  std::string name_;
  std::vector<std::string> class_names_, warnings_;
};

}  // namespace dynamic_slam
