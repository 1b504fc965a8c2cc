#pragma once

#include <filesystem>

#include "dynamic_slam/io/image_preparer.h"
#include "dynamic_slam/system/sequence_runner.h"

namespace dynamic_slam {

// Writes each frame of a run as tracking saw it (frame_picture.h), and how tracking went.
class OverlayWriter {
 public:
  // Makes the folder; throws InputError when files cannot be written there.
  OverlayWriter(std::filesystem::path folder, const Camera& raw_camera, const ImageOptions& options);

  void Write(const RunProgress& progress);

 private:
  std::filesystem::path folder_;
  ImagePreparer preparer_;
  cv::Mat picture_;
};

}  // namespace dynamic_slam
