#pragma once

#include <memory>
#include <optional>
#include <string>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/geometry/camera.h"

namespace dynamic_slam {

struct SourceImage {
  double timestamp_s = 0;
  cv::Mat grey;      // CV_8UC1
  std::string name;  // file or frame number, for messages
};

// A sequence of images with time stamps, read one after the other.
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  // The next readable image, or nothing at the end. An image that is missing, cannot be decoded or has the wrong size,
  // a stamp that goes back and a duplicate are skipped and kept in Problems(); only hopeless sources throw.
  virtual std::optional<SourceImage> Next() = 0;

  // Frames in all where known, else 0.
  virtual size_t FrameCount() const = 0;

  // "tum", "kitti", "euroc", "images", "video".
  virtual std::string Layout() const = 0;

  // The camera that the source itself describes (camera.yaml, calib.txt, sensor.yaml), if any.
  virtual std::optional<Camera> OwnCamera() const = 0;

  // Size of the first image, px.
  virtual cv::Size ImageSize() const = 0;
};

}  // namespace dynamic_slam
