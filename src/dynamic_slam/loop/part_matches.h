#pragma once

#include <utility>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/sim3_estimation.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// Landmarks of two parts of a map that look alike from one keyframe after another. People leave so little of
// a place that no two keyframes have enough matches to know it by (LoopDetector::Detect). Over the keyframes
// of both visits the right matches come again, and most of the wrong ones do not.
class PartMatches {
 public:
  // Keyframes of either part.
  struct Viewpoint {
    KeyframeId here, there;
    int matches = 0;  // of those below that the two make
  };

  // Holds on to the map.
  PartMatches(const Camera& camera, const Map& map, PartId here, PartId there);

  // Those that make some of the matches, the most first.
  const std::vector<Viewpoint>& viewpoints() const { return viewpoints_; }

  // The matches that are about what the two keyframes look at, as if they saw them; the first is `here`.
  std::vector<Sim3Match> From(const Viewpoint& viewpoint) const;

 private:
  using LandmarkPair = std::pair<LandmarkId, LandmarkId>;  // here, there

  // For each place.
  std::vector<std::vector<LandmarkPair>> MatchWithPlaces(const Keyframe& here,
                                                         const std::vector<KeyframeId>& places) const;
  double SigmaPx(const Landmark& landmark) const;

  const Camera& camera_;
  const Map& map_;
  std::vector<LandmarkPair> matches_;  // in ascending order
  std::vector<Viewpoint> viewpoints_;
};

}  // namespace dynamic_slam
