#pragma once

#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/landmark_projector.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

struct FusionCount {
  int linked = 0;  // landmarks found in a keyframe that did not know of them
  int merged = 0;  // pairs of landmarks that were one
};

// Projects landmarks into a keyframe; links what is found, merges what is twice. Passes over landmarks that
// are gone.
class LandmarkFusion {
 public:
  LandmarkFusion(const Camera& camera, const std::vector<float>& octave_scales)
      : projector_(camera, octave_scales) {}

  FusionCount FuseInto(KeyframeId target, const std::vector<LandmarkId>& landmarks, Map* map);

 private:
  LandmarkProjector projector_;
};

}  // namespace dynamic_slam
