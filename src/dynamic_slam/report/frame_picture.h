#pragma once

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/system/sequence_runner.h"

namespace dynamic_slam {

// Of keypoints, BGR: those that hold the pose, those that do so in a dynamic box, those that are not trusted.
inline const cv::Scalar kHoldingColour(90, 220, 90);       // green
inline const cv::Scalar kHoldingInBoxColour(0, 220, 255);  // yellow
inline const cv::Scalar kUntrustedColour(60, 60, 230);     // red

// Draws what tracking knows of a frame on its image, CV_8UC3 as prepared: the mask of the dynamic objects
// (Eq. 11) shaded red, the boxes of all objects, detected ones red and compensated ones green (the paper's
// Fig. 3 and 6), and the keypoints (Fig. 7); grey ones have no landmark.
void DrawFrame(const RunProgress& progress, cv::Mat* picture);

}  // namespace dynamic_slam
