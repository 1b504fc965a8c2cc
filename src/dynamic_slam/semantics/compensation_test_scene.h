#pragma once

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "dynamic_slam/semantics/box_compensation.h"

namespace dynamic_slam {

inline constexpr int kPerson = 0;
inline constexpr int kCar = 1;

// 640 x 480 at 30 frames per second without distortion.
inline Camera TestCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fps = 30;
  camera.fx = camera.fy = 500;
  camera.cx = 320;
  camera.cy = 240;
  return camera;
}

// A detection 100 px wide and 200 px high.
inline Detection At(double x, double y, int class_id = kPerson, double score = 0.9) {
  return {{x, y, 100, 200}, class_id, score};
}

// Feeds a compensation frame by frame.
class Feed {
 public:
  explicit Feed(BoxCompensation* compensation) : compensation_(compensation) {}

  std::vector<CompensatedBox> See(std::optional<std::vector<Detection>> detections,
                                  std::optional<Eigen::Quaterniond> cam_from_last = std::nullopt,
                                  std::vector<PointMotion> motions = {}) {
    const uint32_t frame = next_frame_++;
    return compensation_->Update(
        {FrameId(frame), frame / 30.0, std::move(detections), cam_from_last, std::move(motions)});
  }

 private:
  BoxCompensation* compensation_;
  uint32_t next_frame_ = 0;
};

}  // namespace dynamic_slam
