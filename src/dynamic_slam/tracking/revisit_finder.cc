#include "dynamic_slam/tracking/revisit_finder.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/map/landmark_fusion.h"

namespace dynamic_slam {
namespace {

// Landmarks of another keyframe that one should see: fewer tell nothing.
constexpr int kMinVisible = 40;

// A keyframe sees half or more of what it should see of those about it. Of those of whom it sees less the map
// has things twice.
constexpr double kMostSeenOfStrangers = 0.4;

// Visits with which a keyframe is compared, the ones of which it misses most, and the keyframes of a visit.
constexpr int kVisits = 3;
constexpr size_t kVisitKeyframes = 20;

// Of the links that fit a pose so many can be right, or more are wrong: those on somebody's clothes fit too.
constexpr double kMostlyRight = 0.5;

// Times the greater of two median depths: landmarks are known again from no farther (LandmarkProjector).
constexpr double kReach = 4;

// Far from a prediction more look alike: as for keyframes that are matched by looks.
TrackerOptions WithStricterMatches(TrackerOptions options) {
  options.max_match_distance = std::min(options.max_match_distance, kKeyframeDistance);
  return options;
}

// As it looked from the direction that is most like ours.
const Descriptor& DescriptorFrom(const Map& map, const Landmark& landmark, const Eigen::Vector3d& center) {
  const Eigen::Vector3d to_us = (center - landmark.position()).normalized();
  const Descriptor* best = &landmark.descriptor();
  double best_cosine = -1;
  for (const Observation& observation : landmark.observations()) {
    const Keyframe& by = map.keyframes().At(observation.keyframe);
    const double cosine = to_us.dot((by.CenterInWorld() - landmark.position()).normalized());
    if (cosine <= best_cosine) continue;
    best_cosine = cosine;
    best = &by.features().descriptors[observation.keypoint];
  }
  return *best;
}

}  // namespace

RevisitFinder::RevisitFinder(const Camera& camera, const TrackerOptions& options, SharedMap* map)
    : camera_(camera),
      options_(WithStricterMatches(options)),
      map_(map),
      projector_(camera, map->Read()->octave_scales()),
      pose_tracker_(camera, options_, map->Read()->octave_scales()) {}

int RevisitFinder::LinkAll(const std::function<bool()>& should_stop) {
  DS_TRACE("revisits");
  FindViewpoints();
  revisits_.assign(map_->Read()->keyframes().CreatedCount(), {});
  for (const Viewpoint& viewpoint : viewpoints_) {
    if (should_stop && should_stop()) return 0;
    if (viewpoint.is_of_this_run) revisits_[viewpoint.id.value()] = RevisitsOf(viewpoint);
  }
  std::vector<const Revisit*> believed;  // before links change who shares what
  for (const Viewpoint& viewpoint : viewpoints_) {
    for (const Revisit& revisit : revisits_[viewpoint.id.value()]) {
      if (revisit.inliers >= options_.min_inliers || IsConfirmed(*map_->Read(), revisit))
        believed.push_back(&revisit);
    }
  }
  int links = 0;
  for (const Revisit* revisit : believed) links += Link(*revisit);
  return links;
}

void RevisitFinder::FindViewpoints() {
  viewpoints_.clear();
  const auto map = map_->Read();
  map->keyframes().ForEach([&](const Keyframe& keyframe) {
    viewpoints_.push_back({keyframe.id(), keyframe.part(), keyframe.timestamp_s(), keyframe.CenterInWorld(),
                           map->MedianDepth(keyframe.id()), keyframe.frame_id().IsValid()});
  });
  std::stable_sort(viewpoints_.begin(), viewpoints_.end(),
                   [](const Viewpoint& a, const Viewpoint& b) { return a.timestamp_s < b.timestamp_s; });
}

bool RevisitFinder::Overlap::IsKnown(KeyframeId other) const {
  return visible[other.value()] >= kMinVisible &&
         seen[other.value()] >= kMostSeenOfStrangers * visible[other.value()];
}

std::vector<RevisitFinder::Revisit> RevisitFinder::RevisitsOf(const Viewpoint& viewpoint) {
  std::vector<Revisit> revisits;
  const auto map = map_->Read();
  const Keyframe& keyframe = map->keyframes().At(viewpoint.id);
  const Overlap overlap = OverlapOf(*map, viewpoint);
  std::vector<uint8_t> is_done = OfSameTime(*map, viewpoint, overlap);
  const auto is_open = [&](KeyframeId other) {
    return is_done[other.value()] == 0 && !overlap.IsKnown(other);
  };
  for (int visit = 0; visit < kVisits; ++visit) {
    KeyframeId best;
    int most_missed = 0;
    for (const Viewpoint& other : viewpoints_) {
      const int visible = overlap.visible[other.id.value()];
      const int missed = visible - overlap.seen[other.id.value()];
      if (visible < kMinVisible || missed <= most_missed || !is_open(other.id)) continue;
      most_missed = missed;
      best = other.id;
    }
    if (!best.IsValid()) break;
    std::vector<uint8_t> is_of_visit(is_done.size());
    const auto take = [&](KeyframeId other) { is_of_visit[other.value()] = is_done[other.value()] = 1; };
    take(best);
    for (const CovisibleKeyframe& other : map->keyframes().At(best).BestCovisible(kVisitKeyframes)) {
      if (is_open(other.id)) take(other.id);
    }
    std::optional<Revisit> revisit = Locate(*map, keyframe, OfVisit(*map, overlap, is_of_visit));
    if (revisit.has_value()) revisits.push_back(std::move(*revisit));
  }
  return revisits;
}

// Without those that a keyframe shows that is known: they are where the map about ours has them.
std::vector<LandmarkId> RevisitFinder::OfVisit(const Map& map, const Overlap& overlap,
                                               const std::vector<uint8_t>& is_of_visit) {
  std::vector<LandmarkId> landmarks;
  for (const LandmarkId id : overlap.unseen) {
    bool is_by_visit = false, is_known = false;
    for (const Observation& observation : map.landmarks().At(id).observations()) {
      is_by_visit |= is_of_visit[observation.keyframe.value()] != 0;
      is_known |= overlap.IsKnown(observation.keyframe);
    }
    if (is_by_visit && !is_known) landmarks.push_back(id);
  }
  return landmarks;
}

RevisitFinder::Overlap RevisitFinder::OverlapOf(const Map& map, const Viewpoint& viewpoint) {
  Overlap overlap;
  overlap.visible.resize(map.keyframes().CreatedCount());
  overlap.seen.resize(map.keyframes().CreatedCount());
  std::vector<LandmarkId> around;
  for (const Viewpoint& other : viewpoints_) {
    const double reach = kReach * std::max(viewpoint.depth, other.depth);
    if (other.id == viewpoint.id || other.part != viewpoint.part ||
        !((other.center - viewpoint.center).norm() <= reach))
      continue;
    map.keyframes().At(other.id).ForEachLandmark([&](uint32_t, LandmarkId id) { around.push_back(id); });
  }
  std::sort(around.begin(), around.end());
  around.erase(std::unique(around.begin(), around.end()), around.end());

  projector_.SetPose(map.keyframes().At(viewpoint.id).cam_from_world());
  for (const LandmarkId id : around) {
    const Landmark& landmark = map.landmarks().At(id);
    LandmarkProjection projection;
    if (!projector_.Project(landmark.position(), landmark.normal(), landmark.min_distance(),
                            landmark.max_distance(), &projection))
      continue;
    const bool is_seen = landmark.IsSeenBy(viewpoint.id);
    if (!is_seen) overlap.unseen.push_back(id);
    for (const Observation& observation : landmark.observations()) {
      ++overlap.visible[observation.keyframe.value()];
      overlap.seen[observation.keyframe.value()] += is_seen;
    }
  }
  return overlap;
}

// Away is where a keyframe in between shows what ours can't see, or where tracking was lost: keyframes that
// follow each other have no landmarks in common there. What a road shows is seen from ahead for seconds, less
// and less of it, and linked over these it bends: KITTI 00 erred 1.4 times as much, in twelve runs of twelve.
std::vector<uint8_t> RevisitFinder::OfSameTime(const Map& map, const Viewpoint& viewpoint,
                                               const Overlap& overlap) const {
  std::vector<uint8_t> is_of_same_time(overlap.visible.size());
  is_of_same_time[viewpoint.id.value()] = 1;
  const auto mark = [&](auto begin, auto end) {
    KeyframeId last = viewpoint.id;
    for (auto other = begin; other != end; ++other) {
      if (!other->is_of_this_run || other->part != viewpoint.part) continue;
      if (overlap.visible[other->id.value()] < kMinVisible ||
          map.keyframes().At(other->id).WeightOf(last) <= kSharedByChance)
        return;
      is_of_same_time[other->id.value()] = 1;
      last = other->id;
    }
  };
  const auto self = viewpoints_.begin() + (&viewpoint - viewpoints_.data());
  mark(std::next(self), viewpoints_.end());
  mark(std::make_reverse_iterator(self), viewpoints_.rend());
  return is_of_same_time;
}

std::optional<RevisitFinder::Revisit> RevisitFinder::Locate(const Map& map, const Keyframe& keyframe,
                                                            const std::vector<LandmarkId>& landmarks) {
  view_builder_.Copy(map, landmarks, &view_);
  for (const uint32_t i : view_.near) {
    view_.descriptors[i] = DescriptorFrom(map, map.landmarks().At(view_.ids[i]), keyframe.CenterInWorld());
  }
  Frame frame = FrameOf(keyframe);
  for (const double radius_px : {options_.motion_radius_px, options_.local_map_radius_px}) {
    if (pose_tracker_.TrackLocalMap(view_, radius_px, &frame, &in_view_) == 0) return std::nullopt;
  }
  Revisit revisit{keyframe.id(), frame.cam_from_world, pose_tracker_.RightInliers(), {}};
  if (revisit.inliers < options_.min_motion_inliers) return std::nullopt;
  for (uint32_t i = 0; i < frame.landmarks.size(); ++i) {
    if (frame.landmarks[i].IsValid()) revisit.links.emplace_back(i, frame.landmarks[i]);
  }
  if (revisit.inliers < kMostlyRight * static_cast<double>(revisit.links.size())) return std::nullopt;
  return revisit;
}

// By a keyframe beside it that shows what it shows of the other time where the revisit puts it.
bool RevisitFinder::IsConfirmed(const Map& map, const Revisit& revisit) const {
  const Keyframe& keyframe = map.keyframes().At(revisit.keyframe);
  const Rigid3 here_from_there = keyframe.cam_from_world().Inverse() * revisit.cam_from_world;
  return std::ranges::any_of(keyframe.covisible(), [&](const CovisibleKeyframe& neighbour) {
    if (neighbour.weight <= kSharedByChance) return false;
    const Keyframe& beside = map.keyframes().At(neighbour.id);
    return std::ranges::any_of(revisits_[neighbour.id.value()], [&](const Revisit& other) {
      return AwayFromLinks_px(camera_, map, beside, other.links, beside.cam_from_world() * here_from_there) <=
             options_.local_map_radius_px;
    });
  });
}

int RevisitFinder::Link(const Revisit& revisit) {
  const auto map = map_->Write();
  int links = 0;
  for (const auto& [keypoint, landmark] : revisit.links) {
    const LandmarkId there = map->Resolve(landmark);  // it may be one with another by now
    if (!there.IsValid() || map->landmarks().At(there).IsSeenBy(revisit.keyframe)) continue;
    LinkOrMerge(revisit.keyframe, keypoint, there, map.get());
    ++links;
  }
  return links;
}

}  // namespace dynamic_slam
