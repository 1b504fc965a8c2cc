#pragma once

#include <utility>
#include <vector>

#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// Which landmarks were to be seen in frames, and which were found; the map is told with the next keyframe.
struct VisibilityLog {
  std::vector<LandmarkId> visible, found;
  std::vector<std::pair<LandmarkId, float>> static_evidence;  // to be added to the log-odds

  void Judge(LandmarkId id, float evidence) {
    if (evidence != 0) static_evidence.emplace_back(id, evidence);
  }

  void ApplyTo(Map* map);  // and empties itself
  void Clear() {
    visible.clear();
    found.clear();
    static_evidence.clear();
  }
};

}  // namespace dynamic_slam
