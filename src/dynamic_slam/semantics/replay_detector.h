#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dynamic_slam/semantics/detector.h"

namespace dynamic_slam {

// Says what was detected before: of each image the set whose stamp is nearest, by no more than 0.01 s and no
// more than half of the usual time between sets; nothing where there is none. sets: in order of their stamps,
// boxes in px of the camera's images, as they were before they were prepared.
std::unique_ptr<Detector> MakeReplayDetector(const std::string& name, std::vector<DetectionSet> sets,
                                             std::vector<std::string> class_names);

}  // namespace dynamic_slam
