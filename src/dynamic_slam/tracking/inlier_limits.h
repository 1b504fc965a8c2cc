#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "dynamic_slam/tracking/tracker_options.h"

namespace dynamic_slam {

// The inliers that a pose needs to be believed.
struct InlierLimits {
  int found = 0;
  int right = 0;  // that can be right by how well they fit (RightShare)
};

// keypoints: of the frame, at most as many as are asked for without movers. share_of_movers: of all, those in
// boxes of movers.
inline InlierLimits NeededInliers(const TrackerOptions& options, size_t keypoints, double share_of_movers) {
  // The options count for 1,000 keypoints: among more of them, more fit by chance, or move together.
  const double scale = std::max(1.0, static_cast<double>(keypoints) / 1000);
  const double more = share_of_movers * std::max(options.movers_min_inliers - options.min_inliers, 0);
  // How well they fit tells chance, but not those that move together, for which `more` is.
  return {static_cast<int>(std::lround(scale * (options.min_inliers + more))),
          static_cast<int>(std::lround(scale * options.min_inliers))};
}

}  // namespace dynamic_slam
