#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "dynamic_slam/semantics/detector.h"

namespace dynamic_slam {

// What `spec` names: "none" (null), "hog", the name of a file in config/detectors or a path to one, or
// "boxes:FILE.csv", which replays a box file (io/box_file.h). models_folder: where network files are looked
// for too (semantics/network_files.h), or empty. Throws InputError when something is wrong or missing.
std::unique_ptr<Detector> MakeDetector(const std::string& spec,
                                       const std::filesystem::path& models_folder = {});

// "none, hog, boxes:FILE.csv, NAME or FILE.yaml; ...", for help texts.
std::string DetectorHelp();

}  // namespace dynamic_slam
