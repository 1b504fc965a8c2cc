#pragma once

#include <string>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// BGR.
inline const cv::Scalar kDetectedColour(40, 40, 230);     // red
inline const cv::Scalar kCompensatedColour(60, 170, 40);  // green

// Draws the box's border on the image, CV_8UC3, with the label on a plate at its top left corner.
void DrawBox(const Box& box, const std::string& label, const cv::Scalar& colour, cv::Mat* image);

}  // namespace dynamic_slam
