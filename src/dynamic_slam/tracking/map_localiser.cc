#include "dynamic_slam/tracking/map_localiser.h"

#include <algorithm>
#include <utility>

#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {
namespace {

// A pose that comes from descriptors alone is less exact than a prediction.
constexpr double kRelocalisedSearch = 3.0;

}  // namespace

MapLocaliser::MapLocaliser(const Camera& camera, const TrackerOptions& options,
                           std::vector<float> octave_scales, SharedMap* map)
    : options_(options), map_(map), pose_tracker_(camera, options, std::move(octave_scales)) {}

void MapLocaliser::LookAround(const Frame& frame) {
  DS_TRACE("tracking/view");
  const auto map = map_->Read();
  view_builder_.Build(*map, map.Writes(), frame.landmarks, options_.local_keyframes, &view_);
}

int MapLocaliser::MatchView(double radius_px, Frame* frame) {
  return view_.reference.IsValid() ? pose_tracker_.TrackLocalMap(view_, radius_px, frame, &in_view_) : 0;
}

int MapLocaliser::TrackLocalMap(double radius_px, Frame* frame) {
  LookAround(*frame);
  return MatchViewTwice(radius_px, frame);
}

int MapLocaliser::TrackNear(KeyframeId keyframe, const Rigid3& cam_from_world, double radius_px,
                            Frame* frame) {
  frame->ClearLandmarks();
  frame->cam_from_world = cam_from_world;
  {
    const auto map = map_->Read();
    view_builder_.Build(*map, map.Writes(), map->keyframes().At(keyframe).landmarks(),
                        options_.local_keyframes, &view_);
  }
  return MatchViewTwice(radius_px, frame);
}

int MapLocaliser::MatchViewTwice(double radius_px, Frame* frame) {
  MatchView(radius_px, frame);
  return MatchView(radius_px, frame);
}

void MapLocaliser::Anchor(Frame* frame) const {
  frame->reference = view_.reference;
  frame->cam_from_reference = frame->cam_from_world * view_.reference_from_world.Inverse();
  frame->cam_from_reference.translation /= view_.reference_unit;
  frame->reference_unit = view_.reference_unit;
}

// Those that look like the frame, and the youngest, where the camera was a moment ago.
void MapLocaliser::FindCandidates(const Frame& frame) {
  candidates_.clear();
  if (map_->Read()->keyframes().size() == 0) return;
  // Without the map, which others may want to change meanwhile.
  const std::vector<uint64_t> words =
      PlaceWords(frame.features, frame.static_probability, kMinStaticProbability);
  std::vector<KeyframeId> youngest;
  {
    const auto map = map_->Read();
    for (const PlaceMatch& match : map->places().Query(words)) {
      if (map->PartOf(match.keyframe) != ignored_) candidates_.push_back(match.keyframe);
    }
    map->keyframes().ForEach([&](const Keyframe& keyframe) {
      if (keyframe.part() != ignored_) youngest.push_back(keyframe.id());
    });
  }
  const size_t count = static_cast<size_t>(options_.relocalisation_keyframes);
  candidates_.resize(std::min(candidates_.size(), count - count / 4));
  for (size_t i = youngest.size(); i-- > 0 && candidates_.size() < count;) {
    if (std::find(candidates_.begin(), candidates_.end(), youngest[i]) == candidates_.end()) {
      candidates_.push_back(youngest[i]);
    }
  }
}

std::optional<MapLocaliser::Place> MapLocaliser::Relocalise(int min_inliers, Random& random, Frame* frame) {
  FindCandidates(*frame);
  const int needed = std::max(options_.min_relocalisation_inliers, min_inliers);
  for (const KeyframeId candidate : candidates_) {
    int inliers = 0;
    if (const auto map = map_->Read(); const Keyframe* keyframe = map->keyframes().Find(candidate)) {
      inliers = pose_tracker_.TrackFromKeyframe(*map, *keyframe, random, frame);
    }
    if (inliers < options_.pnp.min_inliers) continue;
    if (TrackLocalMap(kRelocalisedSearch * options_.local_map_radius_px, frame) < min_inliers) continue;
    // Once more from the better pose, with the narrow window.
    inliers = TrackLocalMap(options_.local_map_radius_px, frame);
    if (pose_tracker_.RightInliers() >= needed) return Place{candidate, inliers};
  }
  frame->ClearLandmarks();
  return std::nullopt;
}

}  // namespace dynamic_slam
