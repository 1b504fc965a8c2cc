#pragma once

#include <string>

#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

// The picture, CV_8UC3, as a JPEG within a text that is an address: "data:image/jpeg;base64,...".
std::string JpegDataUri(const cv::Mat& picture, int quality_percent);

}  // namespace dynamic_slam
