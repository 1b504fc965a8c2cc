#pragma once

#include <functional>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/mapping/bundle_terms.h"
#include "dynamic_slam/optimize/bundle_adjustment.h"

namespace dynamic_slam {

// The most probable path through a finished map, which stays as it is: the poses of the views become those
// that what they see of it and the mass of what carries the camera make them. views: of all frames, in the
// order of time. noises: of the parts of the map; measured in the path where a part has none. `should_stop`
// may be empty; when it says so, later poses stay.
void AdjustPath(const Camera& camera, const BundleOptions& options, const MotionNoises& noises,
                const std::function<bool()>& should_stop, SharedMap* map, std::vector<FrameView>* views);

}  // namespace dynamic_slam
