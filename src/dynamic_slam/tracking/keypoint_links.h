#pragma once

#include <utility>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// Keypoints of a keyframe, and the landmarks that they show.
using KeypointLinks = std::vector<std::pair<uint32_t, LandmarkId>>;

// Keyframes that share more landmarks than this share them not only by chance
// (LoopOptions::covisible_weight).
inline constexpr int kSharedByChance = 15;

// Median, from where a pose of the keyframe has the landmarks to their keypoints: the image's width for one
// that is behind, and where there is no link.
double AwayFromLinks_px(const Camera& camera, const Map& map, const Keyframe& keyframe,
                        const KeypointLinks& links, const Rigid3& cam_from_world);

}  // namespace dynamic_slam
