#pragma once

#include <functional>
#include <string>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/map/map.h"
#include "truth_report.h"

namespace dynamic_slam {

// A run at a glance, CV_8UC3: left some keyframes with their keypoints, right the path over the truth and the
// landmarks from above. image_of gives the image of a frame, CV_8UC1. The map must have keyframes.
cv::Mat DrawOverview(const std::string& title, const Map& map,
                     const std::function<cv::Mat(FrameId)>& image_of, const TruthComparison& comparison,
                     const Trajectory& estimate);

}  // namespace dynamic_slam
