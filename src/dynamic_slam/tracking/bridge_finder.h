#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dynamic_slam/geometry/sim3.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/tracking/keypoint_links.h"
#include "dynamic_slam/tracking/known_poses.h"
#include "dynamic_slam/tracking/map_localiser.h"

namespace dynamic_slam {

// A keyframe on one side of a border that the map on the other side sees, and by that how the two fit
// together.
struct Bridge {
  KeyframeId keyframe, neighbour;  // on either side
  Sim3 keyframe_from_neighbour;    // cameras, each in the map's unit of length about it
  // Keypoints of the keyframe that show landmarks of the neighbour's side.
  KeypointLinks links;
  int common = 0;       // landmarks of both sides, by which the scale is known
  double drift_px = 0;  // from where the map has the links' landmarks to their keypoints, median
  std::string reason;   // why it is none; empty when it is one
};

// Joins what the map has of the time before and after a moment in which the camera was lost, in two parts or
// in one that grew from both sides. That the camera was there a moment ago says where to look, so that far
// fewer landmarks are needed than for a place that is known by its looks alone: keyframes of one side are
// localised in the other as frames are, and where a keypoint has a landmark in both, the ratio of their
// depths is that of the scales. Holds the map's lock for moments; changes nothing.
class BridgeFinder {
 public:
  // Poses with none between them, no farther apart than may be guessed over, about which the map has next to
  // no landmarks in common.
  struct Border {
    AnchoredPose before, after;
  };

  BridgeFinder(const Camera& camera, const TrackerOptions& options, SharedMap* map);

  std::vector<Border> Borders(const KnownPoses& known) const;

  // Whether the map still has no landmarks in common about the two.
  bool IsOpen(const Border& border) const;

  // known: the poses about the border.
  Bridge Find(const KnownPoses& known, const Border& border);

 private:
  // A keyframe that has a pose by the other side too.
  struct Sighting {
    Bridge bridge;
    bool is_after = false;  // the keyframe is on the side of the pose after the border
    Rigid3 cam_from_there;  // the other side's world
    double inliers = 0;     // that can be right
    // After the border over before it, of landmarks in both, by the one after it.
    std::map<LandmarkId, double> depth_ratios;
  };

  // Looks for keyframes on the side of `to`, the nearest in time, from the side of `from`.
  void Look(const KnownPoses& known, const AnchoredPose& from, const AnchoredPose& to,
            std::vector<Sighting>* sightings);
  // Of the pose's part, before or after it.
  std::vector<KeyframeId> NearestKeyframes(const AnchoredPose& pose, bool is_after) const;
  // Finds the frame, which is a keyframe of the other side, about the guess.
  bool Localise(const KnownPoses::Guess& guess, Frame* frame);
  Sighting SightingOf(KeyframeId keyframe, bool is_after, const Frame& frame);
  // How many sightings see what they see where the similarity (world after the border from world before it)
  // puts it.
  int CountAgreeing(const std::vector<Sighting>& sightings, const Sim3& after_from_before) const;

  Camera camera_;
  TrackerOptions options_;
  SharedMap* map_;
  MapLocaliser localiser_;
};

}  // namespace dynamic_slam
