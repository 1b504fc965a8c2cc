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
  static constexpr int kBorder = 19;

  // stride: bytes between the rows of every smoothed image that Describe will see.
  explicit SteeredBrief(ptrdiff_t stride);

  // Direction from the keypoint to the centroid of the intensities within 15 px, in (-pi, pi].
  // image: CV_8UC1; (x, y) at least kBorder from its edges.
  static float Angle(const cv::Mat& image, int x, int y);

  // Bit i is set when the first point of test i is darker than the second. centre: the keypoint's pixel, at
  // least kBorder from the edges, in an image smoothed so far (2 px or so) that no single pixel decides a
  // test.
  Descriptor Describe(const uint8_t* centre, float angle_rad) const;

 private:
  static constexpr int kTests = 256;
  static constexpr int kAngles = 128;  // 2.8 degrees apart: at most 0.3 px at the patch's edge

  struct Offsets {
    std::array<int32_t, kTests> first, second;  // bytes from the centre
  };
  std::vector<Offsets> offsets_;  // one per angle
};

}  // namespace dynamic_slam
