#include "dynamic_slam/map/landmark_fusion.h"

#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/geometry/chi2.h"

namespace dynamic_slam {
namespace {

constexpr double kRadiusPx = 3.0;

}  // namespace

FusionCount LandmarkFusion::FuseInto(KeyframeId target_id, const std::vector<LandmarkId>& landmarks,
                                     Map* map) {
  FusionCount count;
  const Keyframe& target = map->keyframes().At(target_id);
  projector_.SetPose(target.cam_from_world());
  for (const LandmarkId candidate : landmarks) {
    const Landmark* landmark = map->landmarks().Find(candidate);  // may have been merged a moment ago
    if (landmark == nullptr || landmark->IsSeenBy(target.id())) continue;
    LandmarkProjection projection;
    if (!projector_.Project(landmark->position(), landmark->normal(), landmark->min_distance(),
                            landmark->max_distance(), &projection)) {
      continue;
    }
    const double scale = map->octave_scales()[static_cast<size_t>(projection.octave)];
    const SearchWindow window{static_cast<float>(projection.px.x()), static_cast<float>(projection.px.y()),
                              static_cast<float>(kRadiusPx * scale), projection.octave - 1,
                              projection.octave + 1};
    const WindowMatch match =
        FindInWindow(target.features(), target.grid(), window, landmark->descriptor(), {});
    if (match.distance > kStrictDistance || !(target.StaticProbability(match.keypoint) > 0)) continue;
    const Keypoint& keypoint = target.keypoint(match.keypoint);
    const double sigma = map->octave_scales()[static_cast<size_t>(keypoint.octave)];
    if ((Eigen::Vector2d(keypoint.x, keypoint.y) - projection.px).squaredNorm() > kChi2TwoDof * sigma * sigma)
      continue;

    const LandmarkId present = target.landmarks()[match.keypoint];
    if (!present.IsValid()) {
      map->Link(target.id(), match.keypoint, candidate);
      map->RefreshLandmark(candidate);
      ++count.linked;
    } else {
      // The one with more evidence stays.
      const bool keep_present =
          map->landmarks().At(present).observations().size() >= landmark->observations().size();
      map->MergeLandmarks(keep_present ? candidate : present, keep_present ? present : candidate);
      ++count.merged;
    }
  }
  return count;
}

}  // namespace dynamic_slam
