#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/features/features.h"

namespace dynamic_slam {

// The oriented patch of ORB (Rublee et al. 2011): its angle from the intensity centroid (sec. 3.2), and the
// binary tests turned by that angle (sec. 4).
class SteeredBrief {
 public:
  // Px between a keypoint and the edge of its image.
  static constexpr int kBorder = 16;

  // stride: bytes between the rows of every blurred image that Describe will see.
  explicit SteeredBrief(ptrdiff_t stride);

  // Direction from the keypoint to the centroid of the intensities within 15 px, in (-pi, pi].
  // image: CV_8UC1; (x, y) at least kBorder from its edges.
  static float Angle(const cv::Mat& image, int x, int y);

  // Bit i is set when the first point of test i is darker than the second in the blurred image.
  // centre: the keypoint's pixel, at least kBorder from the edges.
  Descriptor Describe(const uint8_t* centre, float angle_rad) const;

  // Smooths so that single pixels do not decide the tests: 7x7 Gaussian, sigma 2 px. Leaves 3 px at the edges
  // as they are; *blurred must have the size of the image. buffer: scratch, kept by the caller.
  static void Blur(const cv::Mat& image, cv::Mat* blurred, std::vector<uint8_t>* buffer);

 private:
  static constexpr int kTests = 256;
  static constexpr int kAngles = 128;  // 2.8 degrees apart: at most 0.3 px at the patch's edge

  struct Offsets {
    std::array<int32_t, kTests> first, second;  // bytes from the centre
  };
  std::vector<Offsets> offsets_;  // one per angle
};

}  // namespace dynamic_slam
