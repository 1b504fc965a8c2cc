#pragma once

#include <optional>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/landmark_projector.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

struct FusionCount {
  int linked = 0;  // landmarks found in a keyframe that did not know of them
  int merged = 0;  // pairs of landmarks that were one
};

// The keypoint shows the landmark: it is linked, or merged with the one that the keypoint has; of two the one
// with more evidence stays. Returns whether there were two. The keyframe must not see it with another
// keypoint.
bool LinkOrMerge(KeyframeId keyframe, uint32_t keypoint, LandmarkId landmark, Map* map);

// Projects landmarks into a keyframe. Passes over those that are gone.
class LandmarkFusion {
 public:
  LandmarkFusion(const Camera& camera, const std::vector<float>& octave_scales)
      : projector_(camera, octave_scales) {}

  // Links what is found, merges what is twice.
  FusionCount FuseInto(KeyframeId target, const std::vector<LandmarkId>& landmarks, Map* map);

  // Merges what is twice and was seen, the second time, `min_keyframes_between` keyframes or more before or
  // after the target. Returns the pairs.
  int MergeTwins(KeyframeId target, const std::vector<LandmarkId>& landmarks, uint32_t min_keyframes_between,
                 Map* map);

 private:
  // The target's keypoint that shows the landmark, though the map does not know it.
  std::optional<uint32_t> Find(const Landmark& landmark, const Keyframe& target, const Map& map) const;

  LandmarkProjector projector_;
};

}  // namespace dynamic_slam
