#pragma once

#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/mapping/landmark_factory.h"
#include "dynamic_slam/mapping/mapper_options.h"

namespace dynamic_slam {

struct MappingResult {
  int created = 0;  // landmarks
  int culled_landmarks = 0;
  int merged_landmarks = 0;
  int culled_keyframes = 0;
  BundleSummary bundle;
};

// What happens to the map about a new keyframe: doubtful landmarks go, new ones come, duplicates are fused,
// poses and points are adjusted, redundant keyframes go. Synchronous.
class LocalMapper {
 public:
  LocalMapper(const Camera& camera, const MapperOptions& options, Map* map);

  // `keyframe` is in the map, its landmarks linked.
  MappingResult Process(KeyframeId keyframe);

  // Bundle adjustment over everything, when the sequence is over.
  BundleSummary Finish();

  // The map was emptied.
  void Reset() { recent_landmarks_.clear(); }

 private:
  int CullRecentLandmarks(KeyframeId current);
  int CullRedundantKeyframes(KeyframeId current);

  Camera camera_;
  MapperOptions options_;
  Map* map_;
  LandmarkFactory factory_;
  std::vector<LandmarkId> recent_landmarks_;
};

}  // namespace dynamic_slam
