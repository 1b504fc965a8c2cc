#pragma once

#include <functional>
#include <span>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/mapping/bundle_terms.h"
#include "dynamic_slam/mapping/mapper_options.h"
#include "dynamic_slam/optimize/bundle_adjustment.h"

namespace dynamic_slam {

// Both copy what they need out of the map, solve while others go on with it, and write back unless the map's
// epoch is not `epoch` (any more), or its revision has changed: then the summary is not usable. Links that do
// not fit are broken. Keyframes that were inserted meanwhile move with those that they are linked to.
// `should_stop` may be empty; it is asked between steps.

// Bundle adjustment of the keyframe, its best neighbours and all they see; others that see it too stay fixed.
BundleSummary AdjustLocal(const Camera& camera, const MapperOptions& options, KeyframeId keyframe,
                          uint32_t epoch, const std::function<bool()>& should_stop, SharedMap* map);

// When the sequence is over: what tells where the map is beside its keyframes.
struct PathEvidence {
  std::span<const FrameView> views;  // frames between keyframes
  MotionNoises* noise;               // measured where it is not there yet: later, the path knows of it
  AlignedKeypoints aligned = {};     // of keyframes
};

// The same of the whole map, the origin of each part fixed. With `path` its frames help to tell where the map
// is, and so does the motion of all (MapperOptions::motion_prior); of these frames, only what they say of
// keyframes and landmarks is written back.
BundleSummary AdjustAll(const Camera& camera, const MapperOptions& options,
                        const std::function<bool()>& should_stop, SharedMap* map,
                        const PathEvidence* path = nullptr);

}  // namespace dynamic_slam
