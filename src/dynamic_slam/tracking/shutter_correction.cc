#include "dynamic_slam/tracking/shutter_correction.h"

#include "dynamic_slam/semantics/point_motion.h"

namespace dynamic_slam {
namespace {

void Correct(const Camera& camera, const SteadyMotion& motion, size_t index, double inverse_depth,
             Frame* frame) {
  Keypoint& keypoint = frame->features.keypoints[index];
  const Eigen::Vector2f px =
      AtMiddleRow(camera, motion, frame->ReadPx(index), keypoint.raw_y, inverse_depth).cast<float>();
  keypoint.x = px.x();
  keypoint.y = px.y();
}

}  // namespace

void RememberReadPlaces(Frame* frame) {
  frame->read_px.clear();
  for (const Keypoint& keypoint : frame->features.keypoints)
    frame->read_px.emplace_back(keypoint.x, keypoint.y);
}

void CorrectShutter(const Camera& camera, const SteadyMotion& motion, std::span<const double> inverse_depths,
                    Frame* frame) {
  for (size_t i = 0; i < frame->features.size(); ++i) Correct(camera, motion, i, inverse_depths[i], frame);
}

void CorrectShutter(const Camera& camera, const SteadyMotion& motion, double other_inverse_depth,
                    Frame* frame) {
  for (size_t i = 0; i < frame->features.size(); ++i) {
    double inverse_depth = other_inverse_depth;
    if (frame->landmarks[i].IsValid()) {
      const double depth = (frame->cam_from_world * frame->points[i]).z();
      if (depth > 0) inverse_depth = 1 / depth;
    }
    Correct(camera, motion, i, inverse_depth, frame);
  }
}

void ShutterCorrection::Expect(const std::optional<Rigid3>& frame_from_last, const Frame& last,
                               Frame* frame) {
  if (!IsRolling()) return;
  RememberReadPlaces(frame);
  if (frame_from_last.has_value()) Apply(*frame_from_last, last, frame);
}

void ShutterCorrection::Correct(const Frame& last, Frame* frame) {
  if (!IsRolling()) return;
  depths_.clear();
  for (size_t i = 0; i < frame->landmarks.size(); ++i) {
    if (!frame->landmarks[i].IsValid()) continue;
    const double depth = (frame->cam_from_world * frame->points[i]).z();
    if (depth > 0) depths_.push_back(depth);
  }
  if (!depths_.empty()) inverse_depth_ = 1 / Median(&depths_);
  Apply(frame->cam_from_world * last.cam_from_world.Inverse(), last, frame);
}

void ShutterCorrection::Apply(const Rigid3& frame_from_last, const Frame& last, Frame* frame) const {
  const double dt_s = frame->timestamp_s - last.timestamp_s;
  if (!(dt_s > 0)) return;
  CorrectShutter(camera_, MotionBetween(frame_from_last, dt_s), inverse_depth_, frame);
  frame->grid.Build(frame->features, bounds_);
}

}  // namespace dynamic_slam
