#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/local_view.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/tracking/pose_tracker.h"
#include "dynamic_slam/tracking/tracker_options.h"

namespace dynamic_slam {

// Finds a frame's pose in the map: from landmarks that it has already, from where it should be, or from what
// it looks like. Each call leaves the pose and the landmarks that fit it in the frame, and the inliers are
// those of PoseTracker.
class MapLocaliser {
 public:
  MapLocaliser(const Camera& camera, const TrackerOptions& options, std::vector<float> octave_scales,
               SharedMap* map);

  // Takes the landmarks of the keyframes about those of the frame into view.
  void LookAround(const Frame& frame);

  // Matches what is in view. Returns the inliers; 0 when the map has none of the frame's landmarks. A second
  // time, from the better pose, it finds what the first one just missed.
  int MatchView(double radius_px, Frame* frame);

  // Looks around and matches twice.
  int TrackLocalMap(double radius_px, Frame* frame);

  // The same about the pose that is expected, from the landmarks near a keyframe.
  int TrackNear(KeyframeId keyframe, const Rigid3& cam_from_world, double radius_px, Frame* frame);

  struct Place {
    KeyframeId keyframe;  // by which it was found
    int inliers = 0;
  };
  // Tries keyframes that look like the frame, and the youngest. min_inliers: that a pose of the frame needs.
  // When there is none, the frame has no landmarks any more.
  std::optional<Place> Relocalise(int min_inliers, Random& random, Frame* frame);

  // Relocalise tries those of all parts but this one; of all, if it is not valid.
  void Ignore(PartId part) { ignored_ = part; }

  // Hangs the frame, at its pose, on the keyframe with which it shared most in the last call.
  void Anchor(Frame* frame) const;

  // Keyframes that the last Relocalise had to try.
  size_t candidates() const { return candidates_.size(); }

  PoseTracker& pose_tracker() { return pose_tracker_; }
  const LocalView& view() const { return view_; }                   // that was matched last
  const std::vector<uint8_t>& in_view() const { return in_view_; }  // its entries that should be visible

 private:
  int MatchViewTwice(double radius_px, Frame* frame);
  void FindCandidates(const Frame& frame);

  TrackerOptions options_;
  SharedMap* map_;
  PoseTracker pose_tracker_;
  LocalViewBuilder view_builder_;
  LocalView view_;
  std::vector<uint8_t> in_view_;
  std::vector<KeyframeId> candidates_;
  PartId ignored_;
};

}  // namespace dynamic_slam
