#include "dynamic_slam/tracking/frame_finder.h"

#include <utility>

namespace dynamic_slam {

FrameFinder::FrameFinder(const Camera& camera, const TrackerOptions& options, SharedMap* map)
    : options_(options),
      map_(map),
      shutter_(camera),
      localiser_(camera, options, map->Read()->octave_scales(), map) {}

std::vector<Keypoint> FrameFinder::ReadKeypoints(const Frame& frame) {
  std::vector<Keypoint> keypoints = frame.features.keypoints;
  for (size_t i = 0; i < frame.read_px.size(); ++i)
    keypoints[i].x = frame.read_px[i].x(), keypoints[i].y = frame.read_px[i].y();
  return keypoints;
}

Frame FrameFinder::MakeFrame(FrameId id, double timestamp_s, FeatureSet features,
                             std::vector<float> static_probability) const {
  Frame frame;
  frame.id = id;
  frame.timestamp_s = timestamp_s;
  frame.features = std::move(features);
  frame.static_probability = std::move(static_probability);
  frame.ClearLandmarks();
  shutter_.Begin(&frame);
  return frame;
}

int FrameFinder::Find(const KnownPoses& known, const KnownPoses::Guess& guess, double search, int min_inliers,
                      Frame* frame) {
  CorrectShutterAt(known, guess, frame);
  if (localiser_.TrackNear(guess.keyframe, guess.cam_from_world, search * options_.motion_radius_px, frame) <
      options_.min_motion_inliers)
    return 0;
  CorrectShutterAt(known, {guess.keyframe, frame->cam_from_world}, frame);
  const int inliers = localiser_.TrackLocalMap(options_.local_map_radius_px, frame);
  return localiser_.pose_tracker().RightInliers() >= min_inliers ? inliers : 0;
}

std::optional<AnchoredPose> FrameFinder::PlausiblePose(const KnownPoses& known, Frame* frame) const {
  localiser_.Anchor(frame);
  const AnchoredPose pose{frame->timestamp_s, frame->reference, frame->cam_from_reference};
  return known.IsPlausible(pose) ? std::optional(pose) : std::nullopt;
}

void FrameFinder::CorrectShutterAt(const KnownPoses& known, const KnownPoses::Guess& guess,
                                   Frame* frame) const {
  if (!shutter_.IsRolling()) return;
  const AnchoredPose* nearest = known.Nearest(frame->timestamp_s);
  if (nearest == nullptr) return;
  const auto map = map_->Read();
  if (map->PartOf(nearest->reference) != map->PartOf(guess.keyframe)) return;
  const Rigid3 other = map->PoseFromReference(nearest->reference, nearest->cam_from_reference);
  const SteadyMotion motion =
      MotionBetween(guess.cam_from_world * other.Inverse(), frame->timestamp_s - nearest->timestamp_s);
  const double depth = map->MedianDepth(guess.keyframe);
  shutter_.Move(motion, depth > 0 ? 1 / depth : 0, frame);
}

}  // namespace dynamic_slam
