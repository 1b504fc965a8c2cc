#include "dynamic_slam/tracking/shutter_correction.h"

namespace dynamic_slam {

void ShutterCorrection::Begin(Frame* frame) const {
  frame->grid.Build(frame->features, bounds_);
  if (!IsRolling()) return;
  frame->read_px.clear();
  for (const Keypoint& keypoint : frame->features.keypoints)
    frame->read_px.emplace_back(keypoint.x, keypoint.y);
}

void ShutterCorrection::MoveKeypoint(const SteadyMotion& motion, size_t index, double inverse_depth,
                                     Frame* frame) const {
  Keypoint& keypoint = frame->features.keypoints[index];
  const Eigen::Vector2f px =
      AtMiddleRow(camera_, motion, frame->ReadPx(index), keypoint.raw_y, inverse_depth).cast<float>();
  keypoint.x = px.x();
  keypoint.y = px.y();
}

void ShutterCorrection::Move(const SteadyMotion& motion, std::span<const double> inverse_depths,
                             Frame* frame) const {
  for (size_t i = 0; i < frame->features.size(); ++i) MoveKeypoint(motion, i, inverse_depths[i], frame);
  frame->grid.Build(frame->features, bounds_);
}

void ShutterCorrection::Move(const SteadyMotion& motion, double other_inverse_depth, Frame* frame) const {
  for (size_t i = 0; i < frame->features.size(); ++i) {
    double inverse_depth = other_inverse_depth;
    if (frame->landmarks[i].IsValid()) {
      const double depth = (frame->cam_from_world * frame->points[i]).z();
      if (depth > 0) inverse_depth = 1 / depth;
    }
    MoveKeypoint(motion, i, inverse_depth, frame);
  }
  frame->grid.Build(frame->features, bounds_);
}

void ShutterCorrection::Expect(const std::optional<Rigid3>& frame_from_last, const Frame& last,
                               Frame* frame) const {
  Begin(frame);
  const double dt_s = frame->timestamp_s - last.timestamp_s;
  if (IsRolling() && frame_from_last.has_value() && dt_s > 0)
    Move(MotionBetween(*frame_from_last, dt_s), inverse_depth_, frame);
}

void ShutterCorrection::Correct(const Frame& last, double median_depth, Frame* frame) {
  const double dt_s = frame->timestamp_s - last.timestamp_s;
  if (!(dt_s > 0)) return;
  if (median_depth > 0) inverse_depth_ = 1 / median_depth;
  Move(MotionBetween(frame->cam_from_world * last.cam_from_world.Inverse(), dt_s), inverse_depth_, frame);
}

}  // namespace dynamic_slam
