#pragma once

#include <array>
#include <optional>
#include <span>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rolling_shutter.h"
#include "dynamic_slam/map/frame.h"

namespace dynamic_slam {

// Moves what a rolling shutter read of a frame to the time of the middle row, which is that of the frame's
// pose; Frame::read_px says where it was read. Each call leaves the frame's grid as its keypoints are.
class ShutterCorrection {
 public:
  explicit ShutterCorrection(const Camera& camera) : camera_(camera), bounds_(camera.IdealBounds()) {}

  bool IsRolling() const { return camera_.readout_s > 0; }

  // Of a frame whose keypoints are where they were read. Whatever the shutter is, it has a grid then.
  void Begin(Frame* frame) const;

  // Moves the keypoints from where they were read. inverse_depths: of each keypoint.
  void Move(const SteadyMotion& motion, std::span<const double> inverse_depths, Frame* frame) const;

  // The same with the depths of the frame's landmarks, and another one for what has none.
  void Move(const SteadyMotion& motion, double other_inverse_depth, Frame* frame) const;

  // Begins a frame, and moves its keypoints by the motion that is expected since the last one, if any is.
  void Expect(const std::optional<Rigid3>& frame_from_last, const Frame& last, Frame* frame) const;

  // A rolling shutter: moves the keypoints by the poses of both frames. median_depth: of the frame's
  // landmarks; 0: unknown.
  void Correct(const Frame& last, double median_depth, Frame* frame);

  // A map begins, whose median depth is 1.
  void Reset() { inverse_depth_ = 1; }

 private:
  void MoveKeypoint(const SteadyMotion& motion, size_t index, double inverse_depth, Frame* frame) const;

  Camera camera_;
  std::array<double, 4> bounds_;
  double inverse_depth_ = 1;  // median of the last frame's landmarks
};

}  // namespace dynamic_slam
