#pragma once

#include <vector>

#include "dynamic_slam/geometry/camera.h"

namespace dynamic_slam {

// Camera::Undistort from a table, for the many keypoints of each frame: the shift from raw to ideal px every
// 4 px, linear in between. Within 0.02 px of the exact answer at the corners of a wide lens (EuRoC), mostly
// 0.002; where a raw pixel is 4 ideal ones, at 60 deg of a fisheye, within 0.2 px.
class UndistortionTable {
 public:
  explicit UndistortionTable(const Camera& camera);

  // (x, y): raw px inside the image. Replaces it by the ideal px.
  void Undistort(float* x, float* y) const;

 private:
  static constexpr int kStepPx = 4;
  struct Shift {
    float x, y;
  };
  int columns_ = 0;
  std::vector<Shift> shifts_;  // empty without distortion
};

}  // namespace dynamic_slam
