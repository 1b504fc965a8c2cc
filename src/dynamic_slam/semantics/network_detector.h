#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "dynamic_slam/semantics/detector.h"
#include "dynamic_slam/semantics/detector_file.h"

namespace dynamic_slam {

// A trained network, run by OpenCV's dnn. folders: where its files are looked for beside the detector file
// (ModelFolders). The network is tried on an empty image, so that a file that is missing, broken or described
// wrongly is an InputError here and not at the first frame. A file with another SHA-256 than expected is a
// warning.
std::unique_ptr<Detector> MakeNetworkDetector(const DetectorFile& file,
                                              const std::vector<std::filesystem::path>& folders);

}  // namespace dynamic_slam
