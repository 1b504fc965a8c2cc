#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

// Both convolve with a small symmetric kernel along both axes, made of averages of two bytes rounded up: 32
// pixels in one instruction. in, *out: CV_8UC1 of the same size, not the same memory. row: scratch, kept by
// the caller. The outer 2 px of *out are left as they are.

// Kernel 1 4 6 4 1 / 16: standard deviation 1 px.
void Smooth(const cv::Mat& in, cv::Mat* out, std::vector<uint8_t>* row);

// Kernel 1 0 2 0 1 / 4: standard deviation 1.41 px; 1.73 px after Smooth, which fills the gaps.
void SmoothMore(const cv::Mat& in, cv::Mat* out, std::vector<uint8_t>* row);

}  // namespace dynamic_slam
