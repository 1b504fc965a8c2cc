#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

// Half of a symmetric kernel of 7 taps, the middle first, in 256ths: k[0] + 2 (k[1] + k[2] + k[3]) = 256.
using SmoothingKernel = std::array<uint16_t, 4>;

inline constexpr SmoothingKernel kBinomial5 = {96, 64, 16, 0};  // 1 4 6 4 1: standard deviation 1 px
inline constexpr SmoothingKernel kGauss7 = {56, 49, 33, 18};    // standard deviation 2 px

// Convolves with the kernel along both axes, rounded to 8 bits after each. in, *out: CV_8UC1 of the same
// size. The outer 3 px of *out are left as they are: keypoints are not that near to the edge. row: scratch.
void Smooth(const cv::Mat& in, const SmoothingKernel& kernel, cv::Mat* out, std::vector<uint8_t>* row);

}  // namespace dynamic_slam
