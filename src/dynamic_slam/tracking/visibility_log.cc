#include "dynamic_slam/tracking/visibility_log.h"

#include <algorithm>

#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {

void VisibilityLog::ApplyTo(Map* map) {
  for (const LandmarkId id : visible) {
    if (const LandmarkId now = map->Resolve(id); now.IsValid()) ++map->landmarks().At(now).visible_count;
  }
  for (const LandmarkId id : found) {
    const LandmarkId now = map->Resolve(id);
    if (!now.IsValid()) continue;
    Landmark& landmark = map->landmarks().At(now);
    ++landmark.found_count;
    // Also found where it was not expected.
    landmark.visible_count = std::max(landmark.visible_count, landmark.found_count);
  }
  for (const auto& [id, evidence] : static_evidence) {
    const LandmarkId now = map->Resolve(id);
    if (!now.IsValid()) continue;
    float& odds = map->landmarks().At(now).static_log_odds;
    odds = std::clamp(odds + evidence, -kMaxStaticLogOdds, kMaxStaticLogOdds);
  }
  Clear();
}

}  // namespace dynamic_slam
