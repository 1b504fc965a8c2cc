#pragma once

#include <cstdint>
#include <vector>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/landmark_projector.h"
#include "dynamic_slam/map/local_view.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/optimize/pose_optimizer.h"
#include "dynamic_slam/tracking/tracker_options.h"

namespace dynamic_slam {

// Most that descriptors differ where nothing, or little, says where to look.
inline constexpr int kKeyframeDistance = (kStrictDistance + kLooseDistance) / 2;

// Finds a frame's pose from landmarks: matching, then Eq. (10). Each Track* leaves the pose and the landmarks
// that fit it in the frame and returns how many they are, each counting as much as it can be trusted to be at
// rest (TrustInMatch).
class PoseTracker {
 public:
  PoseTracker(const Camera& camera, const TrackerOptions& options, std::vector<float> octave_scales);

  // Looks for the last frame's landmarks about where `predicted` puts them.
  int TrackFromFrame(const Frame& last, const Rigid3& predicted_cam_from_world, double radius_px,
                     Frame* frame);

  // Matches descriptors with the keyframe's and solves PnP: needs no idea of the pose.
  int TrackFromKeyframe(const Map& map, const Keyframe& keyframe, Random& random, Frame* frame);

  // Looks for the view's landmarks that the frame does not have yet, and optimises the pose over all.
  // in_view[k] becomes 1 when the k-th of view.near should be visible in the frame at its pose before this
  // call.
  int TrackLocalMap(const LocalView& view, double radius_px, Frame* frame, std::vector<uint8_t>* in_view);

  // How many of the inliers of the last pose can be right, as they are trusted.
  double RightInliers() const { return RightShare(estimate_, options_.pose.chi2) * trusted_; }

  // Landmarks that were matched and did not fit the last pose that was found.
  const std::vector<LandmarkId>& rejected() const { return rejected_; }

 private:
  // Optimises the pose over all the frame's landmarks from `initial`; takes away those that do not fit.
  int OptimisePose(const Rigid3& initial_cam_from_world, Frame* frame);

  // Adds the matches that agree in rotation to the frame.
  struct Candidate {
    uint32_t keypoint;
    LandmarkId landmark;
    Eigen::Vector3d point;
    Eigen::Vector3f spread;
    float static_log_odds;
  };
  void AcceptCandidates(Frame* frame);

  // Where somebody may stand before the landmark, any corner may be found in its place.
  int MaxDistance(const Frame& frame, uint32_t keypoint) const;

  // Of known_landmarks_.
  void MarkKnown(bool is_known);
  bool IsKnown(LandmarkId id) const { return id.value() < is_known_.size() && is_known_[id.value()]; }

  // Keypoints that are not to be used count as taken.
  void TakeUnusable(const Frame& frame);

  Camera camera_;
  TrackerOptions options_;
  std::vector<float> octave_scales_;
  LandmarkProjector projector_;
  PoseOptimizer optimizer_;

  // Kept between frames for their memory.
  PoseObservations observations_;
  PoseEstimate estimate_;
  double trusted_ = 0;  // its inliers, each as far as it is trusted
  std::vector<uint32_t> observed_keypoints_;
  std::vector<Candidate> candidates_;
  std::vector<uint8_t> taken_;
  std::vector<LandmarkId> rejected_;
  std::vector<LandmarkId> known_landmarks_;  // that the frame had before TrackLocalMap
  std::vector<bool> is_known_;               // by landmark id; all false between calls
  RotationConsistency rotation_;
};

}  // namespace dynamic_slam
