#include "dynamic_slam/tracking/pose_tracker.h"

#include <algorithm>
#include <cmath>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {
namespace {

// Nearest over second nearest distance of a landmark's candidates in one octave.
constexpr double kWindowRatio = 0.8;
constexpr double kKeyframeRatio = 0.85;

}  // namespace

PoseTracker::PoseTracker(const Camera& camera, const TrackerOptions& options,
                         std::vector<float> octave_scales)
    : camera_(camera),
      options_(options),
      octave_scales_(std::move(octave_scales)),
      projector_(camera, octave_scales_),
      optimizer_(camera, options.pose) {}

int PoseTracker::MaxDistance(const Frame& frame, uint32_t keypoint) const {
  if (frame.StaticProbability(keypoint) >= kMinStaticProbability) return options_.max_match_distance;
  return std::min(options_.max_match_distance, kStrictDistance);
}

int PoseTracker::TrackFromFrame(const Frame& last, const Rigid3& predicted_cam_from_world, double radius_px,
                                Frame* frame) {
  DS_TRACE("tracking/last frame");
  frame->ClearLandmarks();
  TakeUnusable(*frame);
  candidates_.clear();
  rotation_.Clear();
  const Eigen::Matrix3d rotation = predicted_cam_from_world.Matrix();
  for (uint32_t i = 0; i < last.landmarks.size(); ++i) {
    if (!last.landmarks[i].IsValid()) continue;
    const Eigen::Vector3d x_in_cam = rotation * last.points[i] + predicted_cam_from_world.translation;
    if (x_in_cam.z() <= 0) continue;
    const Eigen::Vector2d px = camera_.Project(x_in_cam);
    if (!projector_.IsInImage(px)) continue;
    const Keypoint& last_keypoint = last.features.keypoints[i];
    const float scale = octave_scales_[static_cast<size_t>(last_keypoint.octave)];
    const SearchWindow window{static_cast<float>(px.x()), static_cast<float>(px.y()),
                              static_cast<float>(radius_px) * scale, last_keypoint.octave - 1,
                              last_keypoint.octave + 1};
    const WindowMatch match =
        FindInWindow(frame->features, frame->grid, window, last.features.descriptors[i], taken_);
    if (!match.Found() || match.distance > MaxDistance(*frame, match.keypoint)) continue;
    taken_[match.keypoint] = 1;
    candidates_.push_back(
        {match.keypoint, last.landmarks[i], last.points[i], last.spreads[i], last.static_log_odds[i]});
    rotation_.Add(last_keypoint.angle_rad, frame->features.keypoints[match.keypoint].angle_rad);
  }
  AcceptCandidates(frame);
  return OptimisePose(predicted_cam_from_world, frame);
}

int PoseTracker::TrackFromKeyframe(const Map& map, const Keyframe& keyframe, Random& random, Frame* frame) {
  frame->ClearLandmarks();
  std::vector<uint32_t> with_landmark, usable;
  keyframe.ForEachLandmark([&](uint32_t keypoint, LandmarkId) { with_landmark.push_back(keypoint); });
  for (uint32_t i = 0; i < frame->features.size(); ++i) {
    if (frame->StaticProbability(i) >= kMinStaticProbability) usable.push_back(i);
  }
  const std::vector<Match> matches =
      MatchMutual(keyframe.features(), with_landmark, frame->features, usable,
                  std::min(options_.max_match_distance, kKeyframeDistance), kKeyframeRatio);
  candidates_.clear();
  rotation_.Clear();
  for (const Match& match : matches) {
    const LandmarkId landmark = keyframe.landmarks()[match.first];
    const Landmark& known = map.landmarks().At(landmark);
    candidates_.push_back({match.second, landmark, known.position(), known.spread(), known.static_log_odds});
    rotation_.Add(keyframe.keypoint(match.first).angle_rad,
                  frame->features.keypoints[match.second].angle_rad);
  }
  AcceptCandidates(frame);

  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  std::vector<double> sigmas;
  std::vector<uint32_t> keypoints;
  for (uint32_t i = 0; i < frame->landmarks.size(); ++i) {
    if (!frame->landmarks[i].IsValid()) continue;
    const Keypoint& keypoint = frame->features.keypoints[i];
    points.push_back(frame->points[i]);
    pixels.emplace_back(keypoint.x, keypoint.y);
    sigmas.push_back(octave_scales_[static_cast<size_t>(keypoint.octave)]);
    keypoints.push_back(i);
  }
  const PnpResult pnp = EstimatePnp(camera_, points, pixels, sigmas, options_.pnp, random);
  if (!pnp.success) return 0;
  for (size_t i = 0; i < keypoints.size(); ++i) {
    if (pnp.is_inlier[i] == 0) frame->landmarks[keypoints[i]] = LandmarkId();
  }
  return OptimisePose(pnp.cam_from_world, frame);
}

int PoseTracker::TrackLocalMap(const LocalView& view, double radius_px, Frame* frame,
                               std::vector<uint8_t>* in_view) {
  in_view->resize(view.size());
  std::fill(in_view->begin(), in_view->end(), uint8_t{0});
  TakeUnusable(*frame);
  known_landmarks_.clear();
  for (size_t i = 0; i < frame->landmarks.size(); ++i) {
    if (!frame->landmarks[i].IsValid()) continue;
    taken_[i] = 1;
    known_landmarks_.push_back(frame->landmarks[i]);
  }
  MarkKnown(true);

  projector_.SetPose(frame->cam_from_world);
  for (size_t k = 0; k < view.size(); ++k) {
    const uint32_t i = view.near[k];
    LandmarkProjection projection;
    if (!projector_.Project(view.positions[i], view.normals[i], view.min_distances[i], view.max_distances[i],
                            &projection)) {
      continue;
    }
    (*in_view)[k] = 1;
    if (IsKnown(view.ids[i])) continue;
    const float scale = octave_scales_[static_cast<size_t>(projection.octave)];
    const SearchWindow window{static_cast<float>(projection.px.x()), static_cast<float>(projection.px.y()),
                              static_cast<float>(radius_px) * scale, projection.octave - 1,
                              projection.octave + 1};
    const WindowMatch match = FindInWindow(frame->features, frame->grid, window, view.descriptors[i], taken_);
    if (!match.Found() || match.distance > MaxDistance(*frame, match.keypoint)) continue;
    if (match.octave == match.second_octave && match.distance > kWindowRatio * match.second_distance)
      continue;
    taken_[match.keypoint] = 1;
    frame->landmarks[match.keypoint] = view.ids[i];
    frame->points[match.keypoint] = view.positions[i];
    frame->spreads[match.keypoint] = view.spreads[i];
    frame->static_log_odds[match.keypoint] = view.static_log_odds[i];
  }
  MarkKnown(false);
  return OptimisePose(frame->cam_from_world, frame);
}

void PoseTracker::MarkKnown(bool is_known) {
  for (const LandmarkId id : known_landmarks_) {
    if (id.value() >= is_known_.size()) is_known_.resize(id.value() + 1);
    is_known_[id.value()] = is_known;
  }
}

int PoseTracker::OptimisePose(const Rigid3& initial_cam_from_world, Frame* frame) {
  observations_.Clear();
  observed_keypoints_.clear();
  for (uint32_t i = 0; i < frame->landmarks.size(); ++i) {
    if (!frame->landmarks[i].IsValid()) continue;
    const Keypoint& keypoint = frame->features.keypoints[i];
    observations_.Add(frame->points[i], {keypoint.x, keypoint.y},
                      1.0 / octave_scales_[static_cast<size_t>(keypoint.octave)],
                      TrustInMatch(frame->StaticProbability(i), frame->static_log_odds[i]),
                      frame->spreads[i].cast<double>() / camera_.fx);
    observed_keypoints_.push_back(i);
  }
  rejected_.clear();
  DS_TRACE("tracking/pose");
  optimizer_.Optimize(observations_, initial_cam_from_world, &estimate_);
  trusted_ = 0;
  if (!estimate_.converged) return 0;
  frame->cam_from_world = estimate_.cam_from_world;
  for (size_t i = 0; i < observed_keypoints_.size(); ++i) {
    if (estimate_.is_inlier[i] != 0) {
      trusted_ += observations_.weight[i];
      continue;
    }
    rejected_.push_back(frame->landmarks[observed_keypoints_[i]]);
    frame->landmarks[observed_keypoints_[i]] = LandmarkId();
  }
  return static_cast<int>(std::lround(trusted_));
}

void PoseTracker::TakeUnusable(const Frame& frame) {
  taken_.resize(frame.features.size());
  for (size_t i = 0; i < taken_.size(); ++i) taken_[i] = !(frame.StaticProbability(i) > 0);
}

void PoseTracker::AcceptCandidates(Frame* frame) {
  const std::vector<uint8_t>& keep = rotation_.Judge();
  for (size_t i = 0; i < candidates_.size(); ++i) {
    if (keep[i] == 0) continue;
    frame->landmarks[candidates_[i].keypoint] = candidates_[i].landmark;
    frame->points[candidates_[i].keypoint] = candidates_[i].point;
    frame->spreads[candidates_[i].keypoint] = candidates_[i].spread;
    frame->static_log_odds[candidates_[i].keypoint] = candidates_[i].static_log_odds;
  }
}

}  // namespace dynamic_slam
