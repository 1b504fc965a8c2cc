#include "dynamic_slam/map/landmark_fusion.h"

#include <algorithm>

#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/geometry/chi2.h"

namespace dynamic_slam {
namespace {

constexpr double kRadiusPx = 3.0;

// The one with more evidence stays.
void MergeTwo(LandmarkId present, LandmarkId candidate, Map* map) {
  const bool keep_present = map->landmarks().At(present).observations().size() >=
                            map->landmarks().At(candidate).observations().size();
  map->MergeLandmarks(keep_present ? candidate : present, keep_present ? present : candidate);
}

}  // namespace

bool LinkOrMerge(KeyframeId keyframe, uint32_t keypoint, LandmarkId landmark, Map* map) {
  const LandmarkId present = map->keyframes().At(keyframe).landmarks()[keypoint];
  if (present.IsValid()) {
    MergeTwo(present, landmark, map);
    return true;
  }
  map->Link(keyframe, keypoint, landmark);
  map->RefreshLandmark(landmark);
  return false;
}

FusionCount LandmarkFusion::FuseInto(KeyframeId target_id, const std::vector<LandmarkId>& landmarks,
                                     Map* map) {
  FusionCount count;
  const Keyframe& target = map->keyframes().At(target_id);
  projector_.SetPose(target.cam_from_world());
  for (const LandmarkId candidate : landmarks) {
    const Landmark* landmark = map->landmarks().Find(candidate);  // may have been merged a moment ago
    if (landmark == nullptr) continue;
    const std::optional<uint32_t> keypoint = Find(*landmark, target, *map);
    if (!keypoint.has_value()) continue;
    ++(LinkOrMerge(target_id, *keypoint, candidate, map) ? count.merged : count.linked);
  }
  return count;
}

int LandmarkFusion::MergeTwins(KeyframeId target_id, const std::vector<LandmarkId>& landmarks,
                               uint32_t min_keyframes_between, Map* map) {
  int merged = 0;
  const Keyframe& target = map->keyframes().At(target_id);
  projector_.SetPose(target.cam_from_world());
  const auto is_near = [&](const Observation& observation) {
    const uint32_t a = observation.keyframe.value(), b = target_id.value();
    return std::max(a, b) - std::min(a, b) < min_keyframes_between;
  };
  for (const LandmarkId candidate : landmarks) {
    const Landmark* landmark = map->landmarks().Find(candidate);
    if (landmark == nullptr || std::ranges::any_of(landmark->observations(), is_near)) continue;
    const std::optional<uint32_t> keypoint = Find(*landmark, target, *map);
    if (!keypoint.has_value()) continue;
    const LandmarkId present = target.landmarks()[*keypoint];
    if (!present.IsValid()) continue;
    MergeTwo(present, candidate, map);
    ++merged;
  }
  return merged;
}

std::optional<uint32_t> LandmarkFusion::Find(const Landmark& landmark, const Keyframe& target,
                                             const Map& map) const {
  if (landmark.IsSeenBy(target.id())) return std::nullopt;
  LandmarkProjection projection;
  if (!projector_.Project(landmark.position(), landmark.normal(), landmark.min_distance(),
                          landmark.max_distance(), &projection)) {
    return std::nullopt;
  }
  const double scale = map.octave_scales()[static_cast<size_t>(projection.octave)];
  const SearchWindow window{static_cast<float>(projection.px.x()), static_cast<float>(projection.px.y()),
                            static_cast<float>(kRadiusPx * scale), projection.octave - 1,
                            projection.octave + 1};
  const WindowMatch match = FindInWindow(target.features(), target.grid(), window, landmark.descriptor(), {});
  if (match.distance > kStrictDistance || !(target.StaticProbability(match.keypoint) > 0))
    return std::nullopt;
  const Keypoint& keypoint = target.keypoint(match.keypoint);
  const double sigma = map.octave_scales()[static_cast<size_t>(keypoint.octave)];
  const double error2_px2 = (Eigen::Vector2d(keypoint.x, keypoint.y) - projection.px).squaredNorm();
  if (error2_px2 > kChi2TwoDof * sigma * sigma) return std::nullopt;
  return match.keypoint;
}

}  // namespace dynamic_slam
