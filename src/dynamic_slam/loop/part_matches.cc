#include "dynamic_slam/loop/part_matches.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "dynamic_slam/features/matcher.h"

namespace dynamic_slam {
namespace {

constexpr double kMatchRatio = 0.9;

// So many pairs of keyframes must take two landmarks for one. Of what one pair takes for one 3% are right, of
// what four take 8%, and one in five of those that are each other's most frequent ones (followers 42).
constexpr int kMinPairs = 4;

// Keyframes of a part that are looked at, in equal steps, and places that look like each of these.
constexpr size_t kMostKeyframes = 60, kMostPlaces = 120;

std::vector<KeyframeId> KeyframesOf(const Map& map, PartId part) {
  std::vector<KeyframeId> all, some;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() == part) all.push_back(keyframe.id());
  });
  const size_t count = std::min(all.size(), kMostKeyframes);
  for (size_t i = 0; i < count; ++i) some.push_back(all[i * all.size() / count]);
  return some;
}

std::vector<KeyframeId> PlacesLike(const Map& map, KeyframeId keyframe, PartId part) {
  std::vector<KeyframeId> places;
  for (const PlaceMatch& place : map.places().Query(map.places().WordsOf(keyframe))) {
    if (map.PartOf(place.keyframe) == part && places.size() < kMostPlaces) places.push_back(place.keyframe);
  }
  return places;
}

std::vector<uint32_t> KeypointsWithLandmarks(const Keyframe& keyframe) {
  std::vector<uint32_t> keypoints;
  keyframe.ForEachLandmark([&](uint32_t keypoint, LandmarkId) { keypoints.push_back(keypoint); });
  return keypoints;
}

}  // namespace

PartMatches::PartMatches(const Camera& camera, const Map& map, PartId here, PartId there)
    : camera_(camera), map_(map) {
  std::vector<std::vector<LandmarkPair>> by_viewpoint;
  std::map<LandmarkPair, int> counts;
  for (const KeyframeId own : KeyframesOf(map, here)) {
    const std::vector<KeyframeId> places = PlacesLike(map, own, there);
    for (const KeyframeId place : places) viewpoints_.push_back({own, place});
    for (std::vector<LandmarkPair>& matches : MatchWithPlaces(map.keyframes().At(own), places)) {
      for (const LandmarkPair& match : matches) ++counts[match];
      by_viewpoint.push_back(std::move(matches));
    }
  }
  // A landmark is one with the one it is most often taken for.
  std::map<LandmarkId, int> most;
  for (const auto& [match, count] : counts) {
    for (const LandmarkId id : {match.first, match.second}) most[id] = std::max(most[id], count);
  }
  for (const auto& [match, count] : counts) {
    if (count >= std::max({kMinPairs, most[match.first], most[match.second]})) matches_.push_back(match);
  }
  for (size_t i = 0; i < viewpoints_.size(); ++i) {
    viewpoints_[i].matches = static_cast<int>(
        std::count_if(by_viewpoint[i].begin(), by_viewpoint[i].end(), [&](const LandmarkPair& match) {
          return std::binary_search(matches_.begin(), matches_.end(), match);
        }));
  }
  std::erase_if(viewpoints_, [](const Viewpoint& viewpoint) { return viewpoint.matches == 0; });
  std::stable_sort(viewpoints_.begin(), viewpoints_.end(),
                   [](const Viewpoint& a, const Viewpoint& b) { return a.matches > b.matches; });
}

// By how much the camera was turned about its axis, all places together tell better than each by its few
// matches.
std::vector<std::vector<PartMatches::LandmarkPair>> PartMatches::MatchWithPlaces(
    const Keyframe& here, const std::vector<KeyframeId>& places) const {
  const std::vector<uint32_t> own = KeypointsWithLandmarks(here);
  std::vector<std::vector<Match>> found;
  RotationConsistency rotation;
  for (const KeyframeId place : places) {
    const Keyframe& there = map_.keyframes().At(place);
    found.push_back(MatchMutual(here.features(), own, there.features(), KeypointsWithLandmarks(there),
                                kStrictDistance, kMatchRatio));
    for (const Match& match : found.back())
      rotation.Add(here.keypoint(match.first).angle_rad, there.keypoint(match.second).angle_rad);
  }
  auto keep = rotation.Judge().begin();
  std::vector<std::vector<LandmarkPair>> matches(places.size());
  for (size_t i = 0; i < places.size(); ++i) {
    const Keyframe& there = map_.keyframes().At(places[i]);
    for (const Match& match : found[i]) {
      if (*keep++ != 0)
        matches[i].emplace_back(here.landmarks()[match.first], there.landmarks()[match.second]);
    }
  }
  return matches;
}

std::vector<Sim3Match> PartMatches::From(const Viewpoint& viewpoint) const {
  const Rigid3& here = map_.keyframes().At(viewpoint.here).cam_from_world();
  const Rigid3& there = map_.keyframes().At(viewpoint.there).cam_from_world();
  // Neighbours in time see what is half an image beside it.
  const auto is_about = [&](const Eigen::Vector3d& x) {
    if (!(x.z() > 0)) return false;
    const Eigen::Vector2d px = camera_.Project(x);
    return std::abs(px.x() - camera_.cx) < camera_.width && std::abs(px.y() - camera_.cy) < camera_.height;
  };
  std::vector<Sim3Match> matches;
  for (const auto& [own, other] : matches_) {
    const Landmark& a = map_.landmarks().At(own);
    const Landmark& b = map_.landmarks().At(other);
    const Eigen::Vector3d in_here = here * a.position(), in_there = there * b.position();
    if (!is_about(in_here) || !is_about(in_there)) continue;
    matches.push_back(
        {in_here, in_there, camera_.Project(in_here), camera_.Project(in_there), SigmaPx(a), SigmaPx(b)});
  }
  return matches;
}

double PartMatches::SigmaPx(const Landmark& landmark) const {
  const Observation& seen = landmark.observations().front();
  const Keypoint& keypoint = map_.keyframes().At(seen.keyframe).keypoint(seen.keypoint);
  return map_.octave_scales()[static_cast<size_t>(keypoint.octave)];
}

}  // namespace dynamic_slam
