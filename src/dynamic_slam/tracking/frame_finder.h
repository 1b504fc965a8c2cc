#pragma once

#include <optional>
#include <vector>

#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/tracking/known_poses.h"
#include "dynamic_slam/tracking/map_localiser.h"
#include "dynamic_slam/tracking/shutter_correction.h"

namespace dynamic_slam {

// Finds frames whose turn is long over in the map as it is now, from where they should be.
class FrameFinder {
 public:
  FrameFinder(const Camera& camera, const TrackerOptions& options, SharedMap* map);

  // The frame's keypoints as they were read: a motion that was expected then is not that of the pose.
  static std::vector<Keypoint> ReadKeypoints(const Frame& frame);

  // A frame with features, of which ReadKeypoints are the keypoints, and without landmarks.
  Frame MakeFrame(FrameId id, double timestamp_s, FeatureSet features,
                  std::vector<float> static_probability) const;

  // Leaves pose and landmarks in the frame, and returns the inliers; 0 when too few of them can be right.
  // search: times what the motion model looks through. A rolling shutter's keypoints move by how the camera
  // came here from the nearest pose that is known.
  int Find(const KnownPoses& known, const KnownPoses::Guess& guess, double search, int min_inliers,
           Frame* frame);

  // The frame's pose, hung on the map; none when the camera cannot have come there from those before and
  // after it.
  std::optional<AnchoredPose> PlausiblePose(const KnownPoses& known, Frame* frame) const;

  MapLocaliser& localiser() { return localiser_; }

 private:
  void CorrectShutterAt(const KnownPoses& known, const KnownPoses::Guess& guess, Frame* frame) const;

  TrackerOptions options_;
  SharedMap* map_;
  ShutterCorrection shutter_;
  MapLocaliser localiser_;
};

}  // namespace dynamic_slam
