#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "dynamic_slam/io/image_preparer.h"
#include "dynamic_slam/system/sequence_runner.h"

namespace dynamic_slam {

// Writes each frame of a run as tracking saw it: the objects in it, detected ones red and compensated ones
// green (the paper's Fig. 3 and 6), and how tracking went.
class OverlayWriter {
 public:
  // Makes the folder; throws InputError when files cannot be written there.
  OverlayWriter(std::filesystem::path folder, const Camera& raw_camera, const ImageOptions& options,
                std::vector<std::string> class_names);

  void Write(const RunProgress& progress);

 private:
  std::filesystem::path folder_;
  ImagePreparer preparer_;
  std::vector<std::string> class_names_;
  cv::Mat picture_;
};

}  // namespace dynamic_slam
