#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/features/orb_extractor.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/semantics/frame_objects.h"
#include "dynamic_slam/tracking/depth_seeds.h"
#include "dynamic_slam/tracking/dynamic_filter.h"
#include "dynamic_slam/tracking/initializer.h"
#include "dynamic_slam/tracking/inlier_limits.h"
#include "dynamic_slam/tracking/keyframe_policy.h"
#include "dynamic_slam/tracking/late_judgement.h"
#include "dynamic_slam/tracking/map_localiser.h"
#include "dynamic_slam/tracking/shutter_correction.h"
#include "dynamic_slam/tracking/tracker_options.h"
#include "dynamic_slam/tracking/tracking_state.h"
#include "dynamic_slam/tracking/unconfirmed_poses.h"
#include "dynamic_slam/tracking/visibility_log.h"

namespace dynamic_slam {

// What became of one image.
struct TrackingResult {
  TrackingState state = TrackingState::kInitialising;
  std::string reason;  // one sentence with its number; empty while all is well
  int keypoints = 0;
  DynamicKeypoints dynamic;
  int inliers = 0;  // landmarks that fit the pose
  KeyframeReason keyframe_reason = KeyframeReason::kNone;
  std::vector<KeyframeId> new_keyframes;     // inserted into the map, waiting for local mapping
  uint32_t map_epoch = 0;                    // of the map that they belong to
  std::vector<AnchoredPose> earlier_frames;  // that have a pose since the map was made
  int min_inliers = 0;                       // that a pose of this image needs
  bool is_provisional = false;               // the pose may be withdrawn, or erased with its young part
  int withdrawn = 0;                         // the last poses: by looks, and not confirmed by this image
  bool part_was_erased = false;              // of the map, with the poses of the frames in it
};

// From images to poses: a state machine over initialisation, tracking and being lost. Synchronous; looks at
// the map for moments only, and takes it for granted that others change it in between.
class Tracker {
 public:
  Tracker(const Camera& camera, const OrbOptions& orb, const TrackerOptions& options,
          const DynamicOptions& dynamic, uint64_t seed, SharedMap* map);

  // Begins a frame: takes the features out of the image, which needs neither the map nor the objects in it.
  // grey: CV_8UC1 of the camera's size. mask: empty, or CV_8UC1, not 0 where keypoints are forbidden.
  void Extract(FrameId id, double timestamp_s, const cv::Mat& grey, const cv::Mat& mask);

  // The rotation that the motion model expects since the last image, x_in_this = R x_in_last; after Extract.
  std::optional<Eigen::Quaterniond> PredictedRotation() const;

  // How keypoints in and around dynamic boxes moved since the last image; none when that showed nothing.
  // After Extract.
  std::span<const PointMotion> Motions() const {
    return follows_nothing_ ? std::span<const PointMotion>() : std::span(flow_.motions());
  }

  // Finds the pose of the frame. objects: what is in it. keyframes_waiting: those that local mapping has not
  // come to yet.
  TrackingResult Track(const FrameObjects& objects = {}, int keyframes_waiting = 0);

  // The rotation that was found since the last image; none without a pose in both.
  std::optional<Eigen::Quaterniond> Rotation() const;

  // The map was read from a file: the camera is somewhere in it, or somewhere else. Before the first image.
  void ExpectKnownPlace() { state_ = TrackingState::kLost; }

  // TrackerOptions::localise_only from the next image on. With it, the map must have keyframes.
  void SetLocaliseOnly(bool localise_only);

  // Forgets everything, and empties the map: the same images give the same poses again.
  void Reset();

  // The frame of the last Track(); its pose holds when the state is kTracking.
  const Frame& frame() const { return frame_; }

 private:
  void AcceptPose();
  void RememberKeyframes(const std::vector<KeyframeId>& keyframes);
  void Initialise(TrackingResult* result);
  void StartMap(const InitialProposal& proposal, TrackingResult* result);
  // While the start is not certain: whether the map is still believed.
  void ReviewStart(TrackingResult* result);
  // Erases the part of the map in which the camera is, or was last.
  void ErasePart(TrackingResult* result);
  void LookBesideBoxes();
  void CorrectShutter();
  void ForgetPose();
  PartId PartOfFrame() const;
  bool ShowsNothing();
  bool TrackFrame();
  bool TrackFromLastFrame();
  bool Relocalise();
  InlierLimits Limits() const;
  bool TrackLocalMap();
  void RefreshLastFrame();
  std::optional<Rigid3> PredictMotion(double dt_s) const;
  double MedianDepthOfFrame();
  void CountVisibility();
  void InsertKeyframeIfDue(int keyframes_waiting, TrackingResult* result);
  void StartAnewWhenLostForLong(TrackingResult* result);

  Camera camera_;
  OrbOptions orb_options_;
  TrackerOptions options_;
  SharedMap* map_;
  std::vector<float> octave_scales_;
  OrbExtractor extractor_;
  ShutterCorrection shutter_;
  Initializer initializer_;
  FrameId untold_from_;
  MapLocaliser localiser_;
  DynamicFilter filter_;
  KeypointFlow flow_;
  DepthSeeds seeds_;
  LateJudgement late_judgement_;
  double share_in_boxes_ = 0;       // of the keypoints, those in the boxes of movers
  bool is_starved_ = false;         // boxes leave too few keypoints
  std::vector<cv::Rect> deferred_;  // kept for its memory
  uint64_t seed_;
  Random random_;

  TrackingState state_ = TrackingState::kInitialising;
  Frame frame_, last_;
  bool last_has_pose_ = false;
  // Too few keypoints, though last_ has a pose: the next frame takes this one's place and goes on from last_.
  bool shows_nothing_ = false;
  bool follows_nothing_ = false;  // the image before this one was such a frame
  double image_interval_s_ = 0;   // since the last image
  bool start_is_certain_ = true;
  PartId start_part_;            // of the map, that the last start made
  bool start_is_young_ = false;  // its part is erased when the camera is lost now
  UnconfirmedPoses unconfirmed_;
  std::optional<Rigid3> velocity_;  // this frame's camera from the last frame's camera
  double velocity_dt_s_ = 0;        // the time between these two
  KeyframeId last_keyframe_;
  FrameId last_keyframe_frame_;
  FrameId start_frame_;
  int lost_frames_ = 0;
  int inliers_ = 0;
  int most_inliers_ = 0;  // since the last keyframe
  std::string reason_;
  uint32_t revision_ = 0;  // of the map, when the frame's points were taken out of it
  VisibilityLog visibility_;
  std::vector<double> depths_;  // kept for its memory
};

}  // namespace dynamic_slam
