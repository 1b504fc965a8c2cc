#include "dynamic_slam/mapping/landmark_fusion.h"

#include <vector>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/geometry/chi2.h"
#include "dynamic_slam/map/landmark_projector.h"

namespace dynamic_slam {
namespace {

constexpr double kRadiusPx = 3.0;

void FuseInto(const std::vector<LandmarkId>& landmarks, const Keyframe& target, LandmarkProjector* projector,
              Map* map, FusionCount* count) {
  projector->SetPose(target.cam_from_world());
  for (const LandmarkId candidate : landmarks) {
    const Landmark* landmark = map->landmarks().Find(candidate);  // may have been merged a moment ago
    if (landmark == nullptr || landmark->IsSeenBy(target.id())) continue;
    LandmarkProjection projection;
    if (!projector->Project(landmark->position(), landmark->normal(), landmark->min_distance(),
                            landmark->max_distance(), &projection)) {
      continue;
    }
    const double scale = map->octave_scales()[static_cast<size_t>(projection.octave)];
    const SearchWindow window{static_cast<float>(projection.px.x()), static_cast<float>(projection.px.y()),
                              static_cast<float>(kRadiusPx * scale), projection.octave - 1,
                              projection.octave + 1};
    const WindowMatch match =
        FindInWindow(target.features(), target.grid(), window, landmark->descriptor(), {});
    if (match.distance > kStrictDistance) continue;
    const Keypoint& keypoint = target.keypoint(match.keypoint);
    const double sigma = map->octave_scales()[static_cast<size_t>(keypoint.octave)];
    if ((Eigen::Vector2d(keypoint.x, keypoint.y) - projection.px).squaredNorm() > kChi2TwoDof * sigma * sigma)
      continue;

    const LandmarkId present = target.landmarks()[match.keypoint];
    if (!present.IsValid()) {
      map->Link(target.id(), match.keypoint, candidate);
      map->RefreshLandmark(candidate);
      ++count->linked;
    } else {
      // The one with more evidence stays.
      const bool keep_present =
          map->landmarks().At(present).observations().size() >= landmark->observations().size();
      map->MergeLandmarks(keep_present ? candidate : present, keep_present ? present : candidate);
      ++count->merged;
    }
  }
}

}  // namespace

FusionCount FuseLandmarks(const Camera& camera, const MapperOptions& options, KeyframeId id, Map* map) {
  DS_TRACE("mapping/fuse");
  FusionCount count;
  LandmarkProjector projector(camera, map->octave_scales());
  const Keyframe& keyframe = map->keyframes().At(id);
  const std::vector<CovisibleKeyframe> neighbours =
      keyframe.BestCovisible(static_cast<size_t>(options.fusion_neighbours));

  const std::vector<LandmarkId> mine = keyframe.landmarks();
  std::vector<LandmarkId> theirs;
  for (const CovisibleKeyframe& neighbour : neighbours) {
    const Keyframe& target = map->keyframes().At(neighbour.id);
    theirs.insert(theirs.end(), target.landmarks().begin(), target.landmarks().end());
    FuseInto(mine, target, &projector, map, &count);
  }
  FuseInto(theirs, keyframe, &projector, map, &count);
  return count;
}

}  // namespace dynamic_slam
