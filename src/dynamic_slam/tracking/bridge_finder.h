#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "dynamic_slam/geometry/sim3.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/tracking/known_poses.h"
#include "dynamic_slam/tracking/map_localiser.h"

namespace dynamic_slam {

// A keyframe of one part of the map that another part sees, and by that how the two fit together.
struct Bridge {
  KeyframeId keyframe, neighbour;  // in either part
  Sim3 keyframe_from_neighbour;    // cameras, each in the map's unit of length about it
  // Keypoints of the keyframe that show landmarks of the neighbour's part.
  std::vector<std::pair<uint32_t, LandmarkId>> links;
  int common = 0;      // landmarks of both parts, by which the scale is known
  std::string reason;  // why it is none; empty when it is one
};

// Joins parts of the map where the frames of one follow those of another. That the camera was there a moment
// ago says where to look, so that far fewer landmarks are needed than for a place that is known by its looks
// alone: keyframes of one part are localised in the other as frames are, and where a keypoint has a landmark
// in both, the ratio of their depths is that of the scales. Holds the map's lock for moments; changes
// nothing.
class BridgeFinder {
 public:
  // Poses in two parts, with none between them and no farther apart than may be guessed over.
  struct Border {
    AnchoredPose before, after;
  };

  BridgeFinder(const Camera& camera, const TrackerOptions& options, SharedMap* map);

  static std::vector<Border> Borders(const KnownPoses& known);

  // known: the poses about the border.
  Bridge Find(const KnownPoses& known, const Border& border);

 private:
  // A keyframe that has a pose in the other part too.
  struct Sighting {
    Bridge bridge;
    bool is_after = false;  // the keyframe is in the part of the pose after the border
    Rigid3 cam_from_there;  // the other part's world
    double inliers = 0;     // that can be right
    // After the border over before it, of landmarks in both, by the one after it.
    std::map<LandmarkId, double> depth_ratios;
  };

  // Looks for keyframes of the part of `to`, the nearest in time, from the part of `from`.
  void Look(const KnownPoses& known, const AnchoredPose& from, const AnchoredPose& to,
            std::vector<Sighting>* sightings);
  // Finds the frame, which is a keyframe of another part, about the guess.
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
