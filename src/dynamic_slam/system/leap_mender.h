#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/system/tracked_frames.h"
#include "dynamic_slam/tracking/pose_refiner.h"
#include "dynamic_slam/tracking/tracker_options.h"

namespace dynamic_slam {

// Looks anew for frames where the path leaps, as the camera cannot have done: without what the map has of
// them (docs/adr/0009-several-maps.md). Keeps none of what it is given: that has to outlive it.
class LeapMender {
 public:
  LeapMender(const Camera& camera, const TrackerOptions& options, uint64_t seed, const PoseRefiner& kept,
             TrackedFrames* tracked, SharedMap* map)
      : camera_(camera), options_(options), seed_(seed), kept_(kept), tracked_(tracked), map_(map) {}

  // What lies on one side of all leaps, and whose frames the rest of the map has elsewhere, becomes a part of
  // its own; those frames get their pose in the rest. Frames there that were found later only, by what they
  // look like, have none any more. `should_stop` may be empty. Returns how many pieces.
  int CutOffSides(const std::function<bool()>& should_stop);

  // Tracking goes astray before it is lost, and may have begun so: ends with which the path leaps, and with
  // their frames' poses in the rest of the map does not, have those. What is not found of them has none.
  int MendEnds(const std::function<bool()>& should_stop);

 private:
  // Returns how many of them were wrong, each with all others in place.
  int Mend(std::span<const TrackedFrames::Piece> pieces, const std::function<bool()>& should_stop);

  const Camera& camera_;
  const TrackerOptions& options_;
  uint64_t seed_;
  const PoseRefiner& kept_;
  TrackedFrames* tracked_;
  SharedMap* map_;
};

}  // namespace dynamic_slam
