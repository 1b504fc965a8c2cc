#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rolling_shutter.h"
#include "dynamic_slam/map/frame.h"

namespace dynamic_slam {

// What a rolling shutter read of a frame is moved to the time of the middle row, which is that of the frame's
// pose. Frame::read_px says where it was read.

// Right after extraction.
void RememberReadPlaces(Frame* frame);

// Moves the keypoints from where they were read; their grid does not follow. inverse_depths: of each
// keypoint.
void CorrectShutter(const Camera& camera, const SteadyMotion& motion, std::span<const double> inverse_depths,
                    Frame* frame);

// The same with the depths of the frame's landmarks, and another one for what has none.
void CorrectShutter(const Camera& camera, const SteadyMotion& motion, double other_inverse_depth,
                    Frame* frame);

// The same for the frames of a sequence, one after the other, with their grids. Does nothing for a camera
// that reads all rows at once.
class ShutterCorrection {
 public:
  explicit ShutterCorrection(const Camera& camera) : camera_(camera), bounds_(camera.IdealBounds()) {}

  bool IsRolling() const { return camera_.readout_s > 0; }

  // Right after extraction: by the motion that is expected since the last frame, if any is.
  void Expect(const std::optional<Rigid3>& frame_from_last, const Frame& last, Frame* frame);

  // By the poses of both frames.
  void Correct(const Frame& last, Frame* frame);

  // A map begins, whose median depth is 1.
  void Reset() { inverse_depth_ = 1; }

 private:
  void Apply(const Rigid3& frame_from_last, const Frame& last, Frame* frame) const;

  Camera camera_;
  std::array<double, 4> bounds_;
  double inverse_depth_ = 1;    // median of the last frame's landmarks
  std::vector<double> depths_;  // kept for its memory
};

}  // namespace dynamic_slam
