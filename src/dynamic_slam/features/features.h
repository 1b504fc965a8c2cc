#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace dynamic_slam {

// 256 binary tests of a steered BRIEF descriptor (Rublee et al., ORB, 2011), test i in bit i % 64 of
// word i / 64.
using Descriptor = std::array<uint64_t, 4>;

// Number of differing bits, 0 to 256.
inline int HammingDistance(const Descriptor& a, const Descriptor& b) {
  return std::popcount(a[0] ^ b[0]) + std::popcount(a[1] ^ b[1]) + std::popcount(a[2] ^ b[2]) +
         std::popcount(a[3] ^ b[3]);
}

struct Keypoint {
  float x = 0, y = 0;          // ideal px, at full resolution (Camera::Undistort of the raw position)
  float raw_x = 0, raw_y = 0;  // raw px, at full resolution
  float angle_rad = 0;         // orientation of the patch (intensity centroid), in (-pi, pi]
  float response = 0;          // FAST score
  int32_t octave = 0;          // pyramid level
};

// The features of one image; keypoints[i] has descriptors[i].
struct FeatureSet {
  std::vector<Keypoint> keypoints;
  std::vector<Descriptor> descriptors;

  size_t size() const { return keypoints.size(); }
  void Clear() {
    keypoints.clear();
    descriptors.clear();
  }
};

}  // namespace dynamic_slam
