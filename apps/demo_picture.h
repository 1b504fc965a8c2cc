#pragma once

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "experiment.h"

namespace dynamic_slam {

// What the demo shows of a scene.
struct DemoScene {
  std::string name;
  Trajectory truth;
  ExperimentRun with, without;  // the semantic part
};

// All scenes at a glance, CV_8UC3, one below the other: left frames with boxes, mask and keypoints, right
// both paths over the truth, from above.
cv::Mat DrawDemo(const std::vector<DemoScene>& scenes);

}  // namespace dynamic_slam
