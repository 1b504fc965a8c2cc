#include "dynamic_slam/tracking/bridge_finder.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include <fmt/format.h>

#include "dynamic_slam/base/percentile.h"
#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {
namespace {

// Keyframes that share most with one, on either side of a border: the map about that one. Across a border
// no two share more than what is there by chance.
constexpr int kNeighbours = 10;

// Keyframes on either side of a border that are looked for from the other. Those beside it are from the turn
// in which the camera was lost, and show the least.
constexpr size_t kKeyframes = 12;

// Landmarks by which the scale is known: with each as well as below, to 8%.
constexpr int kMinCommon = 10;

// By how much the ratio of depths may differ from landmark to landmark, one standard deviation: as well as a
// depth is known (Sim3Estimate). Else one of the parts has no scale of its own: it drifted, or is on movers.
constexpr double kMaxScaleSpread = 0.2;

// One keyframe may stand wrong; two that agree do not.
constexpr int kMinAgreeing = 2;

// They agree where the landmarks that one shows are no farther from where the other has them than loops look.
constexpr double kAgreement_px = 10;

// Standard deviation, from the quartiles of a Gaussian.
double Spread(std::vector<double>* values) {
  return 0.7413 * (Percentile(0.75, values) - Percentile(0.25, values));
}

std::vector<KeyframeId> MapAbout(const Map& map, const AnchoredPose& pose) {
  std::vector<KeyframeId> keyframes{map.ResolveKeyframe(pose.reference).keyframe};
  for (const CovisibleKeyframe& other : map.keyframes().At(keyframes[0]).BestCovisible(kNeighbours))
    keyframes.push_back(other.id);
  return keyframes;
}

Sim3 ScaleBy(double scale) { return {scale, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()}; }

}  // namespace

BridgeFinder::BridgeFinder(const Camera& camera, const TrackerOptions& options, SharedMap* map)
    : camera_(camera),
      options_(options),
      map_(map),
      localiser_(camera, options, map->Read()->octave_scales(), map) {}

std::vector<BridgeFinder::Border> BridgeFinder::Borders(const KnownPoses& known) const {
  std::vector<Border> borders;
  const KnownPoses::ByStamp& poses = known.by_stamp();
  if (poses.empty()) return borders;
  for (auto pose = poses.begin(); std::next(pose) != poses.end(); ++pose) {
    const Border border{pose->second, std::next(pose)->second};
    const double gap_s = border.after.timestamp_s - border.before.timestamp_s;
    if (gap_s <= known.max_gap_s() && IsOpen(border)) borders.push_back(border);
  }
  return borders;
}

bool BridgeFinder::IsOpen(const Border& border) const {
  const auto map = map_->Read();
  const std::vector<KeyframeId> before = MapAbout(*map, border.before), after = MapAbout(*map, border.after);
  return std::find_first_of(before.begin(), before.end(), after.begin(), after.end(),
                            [&](KeyframeId a, KeyframeId b) {
                              return a == b || map->keyframes().At(a).WeightOf(b) > kSharedByChance;
                            }) == before.end();
}

Bridge BridgeFinder::Find(const KnownPoses& known, const Border& border) {
  DS_TRACE("backfill/bridge");
  std::vector<Sighting> sightings;
  Look(known, border.before, border.after, &sightings);
  Look(known, border.after, border.before, &sightings);

  Bridge none;
  // Each landmark once, from the keyframe nearest to the border.
  std::map<LandmarkId, double> by_landmark;
  for (const Sighting& sighting : sightings)
    by_landmark.insert(sighting.depth_ratios.begin(), sighting.depth_ratios.end());
  std::vector<double> ratios;
  for (const auto& [landmark, ratio] : by_landmark) ratios.push_back(ratio);
  none.common = static_cast<int>(ratios.size());
  {
    const auto map = map_->Read();
    none.keyframe = map->ResolveKeyframe(border.after.reference).keyframe;
    none.neighbour = map->ResolveKeyframe(border.before.reference).keyframe;
  }
  if (none.common < kMinCommon) {
    none.reason = fmt::format("{} landmarks are on both sides < {}", none.common, kMinCommon);
    return none;
  }
  const double scale = Percentile(0.5, &ratios);
  if (const double spread = Spread(&ratios) / scale; spread > kMaxScaleSpread) {
    none.reason = fmt::format("depths of landmarks on both sides differ by {:.0f}% > {:.0f}% about one scale",
                              100 * spread, 100 * kMaxScaleSpread);
    return none;
  }

  const Sighting* best = nullptr;
  int most_agreeing = 0;
  for (const Sighting& sighting : sightings) {
    Sim3 after_from_before;
    {
      const auto map = map_->Read();
      const Sim3 cam_from_here = ToSim3(map->keyframes().At(sighting.bridge.keyframe).cam_from_world());
      const Sim3 cam_from_there = ToSim3(sighting.cam_from_there);
      after_from_before = sighting.is_after ? cam_from_here.Inverse() * ScaleBy(scale) * cam_from_there
                                            : cam_from_there.Inverse() * ScaleBy(scale) * cam_from_here;
    }
    const int agreeing = CountAgreeing(sightings, after_from_before);
    if (best != nullptr && std::pair(agreeing, sighting.inliers) <= std::pair(most_agreeing, best->inliers))
      continue;
    best = &sighting;
    most_agreeing = agreeing;
  }
  if (most_agreeing < kMinAgreeing) {
    none.reason = fmt::format("{} of {} keyframes by which the sides fit together agree < {}", most_agreeing,
                              sightings.size(), kMinAgreeing);
    return none;
  }

  Bridge bridge = best->bridge;
  bridge.common = none.common;
  const auto map = map_->Read();
  const Rigid3 motion =
      best->cam_from_there * map->keyframes().At(bridge.neighbour).cam_from_world().Inverse();
  bridge.keyframe_from_neighbour = ScaleBy(best->is_after ? scale : 1 / scale) * ToSim3(motion);
  const Keyframe& keyframe = map->keyframes().At(bridge.keyframe);
  bridge.drift_px = AwayFromLinks_px(camera_, *map, keyframe, bridge.links, keyframe.cam_from_world());
  return bridge;
}

void BridgeFinder::Look(const KnownPoses& known, const AnchoredPose& from, const AnchoredPose& to,
                        std::vector<Sighting>* sightings) {
  constexpr double kEver = std::numeric_limits<double>::infinity();
  const bool is_after = to.timestamp_s > from.timestamp_s;
  PartId part;
  double unit = 1;  // of `to` in that of `from`, about
  {
    const auto map = map_->Read();
    part = map->PartOf(from.reference);
    const double depth_here = map->MedianDepth(map->ResolveKeyframe(from.reference).keyframe);
    const double depth_there = map->MedianDepth(map->ResolveKeyframe(to.reference).keyframe);
    if (map->PartOf(to.reference) != part && depth_here > 0 && depth_there > 0)
      unit = depth_here / depth_there;
  }
  const std::vector<KnownPoses::Guess> guesses =
      known.Within(part, is_after ? -kEver : from.timestamp_s, is_after ? from.timestamp_s : kEver)
          .Guesses(to.timestamp_s);
  for (const KeyframeId id : NearestKeyframes(to, is_after)) {
    Frame frame;
    Rigid3 keyframe_from_frame;
    {
      const auto map = map_->Read();
      const Keyframe& keyframe = map->keyframes().At(id);
      frame = FrameOf(keyframe);
      keyframe_from_frame =
          keyframe.cam_from_world() * map->PoseFromReference(to.reference, to.cam_from_reference).Inverse();
    }
    keyframe_from_frame.translation *= unit;
    const bool is_found = std::any_of(guesses.begin(), guesses.end(), [&](const KnownPoses::Guess& guess) {
      return Localise({guess.keyframe, keyframe_from_frame * guess.cam_from_world}, &frame);
    });
    if (!is_found) continue;
    Sighting sighting = SightingOf(id, is_after, frame);
    // Where the map about the other side has the keyframe itself, it says nothing new.
    if (sighting.bridge.neighbour != id) sightings->push_back(std::move(sighting));
  }
}

std::vector<KeyframeId> BridgeFinder::NearestKeyframes(const AnchoredPose& pose, bool is_after) const {
  std::vector<std::pair<double, KeyframeId>> by_time;
  const auto map = map_->Read();
  map->keyframes().ForEach([&](const Keyframe& keyframe) {
    const bool is_of_this_run = keyframe.frame_id().IsValid();  // a map that was loaded has other stamps
    const double away_s = (is_after ? 1 : -1) * (keyframe.timestamp_s() - pose.timestamp_s);
    if (is_of_this_run && keyframe.part() == map->PartOf(pose.reference) && away_s >= 0)
      by_time.emplace_back(away_s, keyframe.id());
  });
  std::sort(by_time.begin(), by_time.end());
  std::vector<KeyframeId> nearest;
  for (size_t i = 0; i < std::min(by_time.size(), kKeyframes); ++i) nearest.push_back(by_time[i].second);
  return nearest;
}

bool BridgeFinder::Localise(const KnownPoses::Guess& guess, Frame* frame) {
  // A keyframe does not say how much of it was in the boxes of movers: as if all had been.
  const int found = std::max(options_.min_inliers, options_.movers_min_inliers);
  for (const double search : KnownPoses::kSearches) {
    if (localiser_.TrackNear(guess.keyframe, guess.cam_from_world, search * options_.motion_radius_px,
                             frame) < options_.min_motion_inliers)
      continue;
    if (localiser_.TrackLocalMap(options_.local_map_radius_px, frame) >= found &&
        localiser_.pose_tracker().RightInliers() >= options_.min_inliers)
      return true;
  }
  return false;
}

BridgeFinder::Sighting BridgeFinder::SightingOf(KeyframeId id, bool is_after, const Frame& frame) {
  Sighting sighting;
  sighting.is_after = is_after;
  sighting.cam_from_there = frame.cam_from_world;
  sighting.inliers = localiser_.pose_tracker().RightInliers();
  sighting.bridge.keyframe = id;
  const auto map = map_->Read();
  sighting.bridge.neighbour = map->ResolveKeyframe(localiser_.view().reference).keyframe;
  const Keyframe& keyframe = map->keyframes().At(id);
  for (uint32_t keypoint = 0; keypoint < frame.landmarks.size(); ++keypoint) {
    const LandmarkId there = map->Resolve(frame.landmarks[keypoint]);
    const LandmarkId here = keyframe.landmarks()[keypoint];
    if (!there.IsValid() || here == there) continue;
    sighting.bridge.links.emplace_back(keypoint, there);
    if (!here.IsValid()) continue;
    const double depth = (keyframe.cam_from_world() * map->landmarks().At(here).position()).z();
    const double depth_there = (frame.cam_from_world * map->landmarks().At(there).position()).z();
    if (!(depth > 0 && depth_there > 0)) continue;
    sighting.depth_ratios.emplace(is_after ? here : there,
                                  is_after ? depth / depth_there : depth_there / depth);
  }
  return sighting;
}

int BridgeFinder::CountAgreeing(const std::vector<Sighting>& sightings, const Sim3& after_from_before) const {
  const auto map = map_->Read();
  return static_cast<int>(std::count_if(sightings.begin(), sightings.end(), [&](const Sighting& sighting) {
    const Sim3 here_from_there = sighting.is_after ? after_from_before : after_from_before.Inverse();
    const Keyframe& keyframe = map->keyframes().At(sighting.bridge.keyframe);
    const Rigid3 by_similarity = ToRigid3(ToSim3(keyframe.cam_from_world()) * here_from_there);
    return AwayFromLinks_px(camera_, *map, keyframe, sighting.bridge.links, by_similarity) <= kAgreement_px;
  }));
}

}  // namespace dynamic_slam
