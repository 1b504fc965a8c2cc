#pragma once

#include <functional>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/landmark_fusion.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/mapping/landmark_factory.h"
#include "dynamic_slam/mapping/mapper_options.h"
#include "dynamic_slam/optimize/bundle_adjustment.h"

namespace dynamic_slam {

struct MappingResult {
  int created = 0;  // landmarks
  int culled_landmarks = 0;
  int merged_landmarks = 0;
  int culled_keyframes = 0;
  BundleSummary bundle;
  bool abandoned = false;  // the keyframe's map was given up before, or meanwhile
};

// What happens to the map about a new keyframe: doubtful landmarks go, new ones come, duplicates are fused,
// poses and points are adjusted, redundant keyframes go. Synchronous; it holds the map's lock for moments
// only, so that tracking goes on meanwhile. No one else takes landmarks or keyframes away, except all at once
// (Map::epoch).
class LocalMapper {
 public:
  LocalMapper(const Camera& camera, const MapperOptions& options, SharedMap* map);

  // `keyframe` was put into the map of this epoch, its landmarks linked. `should_stop` may be empty; when it
  // says so, bundle adjustment ends with what it has.
  MappingResult Process(KeyframeId keyframe, uint32_t epoch, const std::function<bool()>& should_stop = {});

  // When the sequence is over: bundle adjustment over everything, and again with those landmarks made one
  // that turn out to be.
  BundleSummary Finish(const std::function<bool()>& should_stop = {});

  // Whether Process culls redundant keyframes. To be called while it does not run.
  void SetCullsKeyframes(bool culls) { culls_keyframes_ = culls; }

 private:
  // Runs look(const Map&) or change(Map*) with the map locked. False, and not run, when the map is not that
  // of the epoch any more.
  template <class Fn>
  bool Look(Fn&& look) const {
    const auto map = map_->Read();
    if (map->epoch() != epoch_) return false;
    look(*map);
    return true;
  }
  template <class Fn>
  bool Change(Fn&& change) {
    const auto map = map_->Write();
    if (map->epoch() != epoch_) return false;
    change(map.get());
    return true;
  }

  // One step each; false when the map was given up.
  bool RefreshSeen(KeyframeId current);
  bool CreateLandmarks(KeyframeId current, MappingResult* result);
  bool FuseLandmarks(KeyframeId current, MappingResult* result);
  bool CullRedundantKeyframes(KeyframeId current, MappingResult* result);
  // Landmarks from a file, near the keyframe, that have moved since the visit in which they were made: they
  // are not found any more where they should be.
  void CullMovedLandmarks(KeyframeId current, Map* map, MappingResult* result);
  void CullRecentLandmarks(KeyframeId current, Map* map, MappingResult* result);
  // Over the whole map. Returns the pairs.
  int MergeTwins(const std::function<bool()>& should_stop);
  bool IsRedundant(const Map& map, const Keyframe& keyframe) const;

  Camera camera_;
  MapperOptions options_;
  SharedMap* map_;
  LandmarkFactory factory_;
  LandmarkFusion fusion_;
  bool culls_keyframes_ = true;
  uint32_t epoch_ = 0;
  std::vector<LandmarkId> recent_landmarks_;  // of the epoch
};

}  // namespace dynamic_slam
