#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/semantics/point_motion.h"
#include "dynamic_slam/tracking/box_marks.h"

namespace dynamic_slam {

// Where keypoints of one frame are in the next one, matched by descriptors about where the camera's rotation
// takes them. Only in and around the given boxes: elsewhere landmarks tell more.
class KeypointFlow {
 public:
  // How far around a box, over its mean side: an arm's length, and as much as selective tracking looks at
  // (SelectiveOptions::ring_ratio).
  static constexpr double kReach = 0.25;

  // What an object or the camera's translation adds to the camera's rotation, at most: somebody who walks
  // past at 2.3 m/s and a distance of 2 m.
  static constexpr double kMaxRate_rad_s = 1.15;

  KeypointFlow(const Camera& camera, std::vector<float> octave_scales)
      : camera_(camera), octave_scales_(std::move(octave_scales)) {}

  // Of which keypoints: all, or witnesses that speak for the others around them (ChooseWitnesses).
  enum class Of { kAll, kWitnesses };

  // boxes: of objects in the last frame, px of the raw image. frame_from_last: x_in_frame = R x_in_last.
  void Match(const Frame& last, std::span<const Box> boxes,
             const std::optional<Eigen::Quaterniond>& frame_from_last, const Frame& frame, Of of = Of::kAll);

  // No matches.
  void Clear(const Frame& frame);

  // For each keypoint of the frame the one of the last frame, or kNotFollowed; and those that have one.
  const std::vector<uint32_t>& last_keypoints() const { return last_keypoints_; }
  std::span<const uint32_t> followed() const { return followed_; }

  bool IsOfWitnesses() const { return is_of_witnesses_; }

  // How far keypoints were looked for.
  double radius_px() const { return radius_px_; }

  // The same as motions, px of the raw image.
  const std::vector<PointMotion>& motions() const { return motions_; }

 private:
  Camera camera_;
  std::vector<float> octave_scales_;
  double radius_px_ = 1;
  bool is_of_witnesses_ = false;
  std::vector<uint32_t> last_keypoints_, before_;  // before_: those of the last frame
  std::vector<uint32_t> followed_;
  BoxMarks near_;                // on the last frame's keypoints: WitnessesOf the boxes about them
  std::vector<uint32_t> asked_;  // of them
  std::vector<int> distances_;
  std::vector<PointMotion> motions_;
};

}  // namespace dynamic_slam
