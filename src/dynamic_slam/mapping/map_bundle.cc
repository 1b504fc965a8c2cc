#include "dynamic_slam/mapping/map_bundle.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// A bundle problem made of parts of the map, and the way back.
class MapBundle {
 public:
  explicit MapBundle(Map* map)
      : map_(map),
        pose_of_(map->keyframes().CreatedCount(), kNone),
        seen_(map->landmarks().CreatedCount(), 0) {}

  void AddPose(KeyframeId id, bool fixed) {
    pose_of_[id.value()] = static_cast<uint32_t>(problem_.poses.size());
    problem_.poses.push_back({map_->keyframes().At(id).cam_from_world(), fixed});
    keyframes_.push_back(id);
  }
  bool HasPose(KeyframeId id) const { return pose_of_[id.value()] != kNone; }

  void AddLandmarksOf(KeyframeId id) {
    for (const LandmarkId landmark : map_->keyframes().At(id).landmarks()) {
      if (!landmark.IsValid() || seen_[landmark.value()] != 0) continue;
      seen_[landmark.value()] = 1;
      landmarks_.push_back(landmark);
    }
  }
  const std::vector<LandmarkId>& landmarks() const { return landmarks_; }

  BundleSummary Solve(const Camera& camera, const BundleOptions& options) {
    for (const LandmarkId id : landmarks_) {
      const Landmark& landmark = map_->landmarks().At(id);
      const uint32_t point = static_cast<uint32_t>(problem_.points.size());
      problem_.points.push_back({landmark.position(), false});
      for (const Observation& observation : landmark.observations()) {
        if (!HasPose(observation.keyframe)) continue;
        const Keypoint& keypoint = map_->keyframes().At(observation.keyframe).keypoint(observation.keypoint);
        problem_.observations.push_back({pose_of_[observation.keyframe.value()],
                                         point,
                                         {keypoint.x, keypoint.y},
                                         1.0 / map_->octave_scales()[static_cast<size_t>(keypoint.octave)],
                                         1.0});
        links_.push_back(observation);
      }
    }
    std::vector<uint8_t> is_outlier;
    const BundleSummary summary = AdjustBundle(camera, options, {}, &problem_, &is_outlier);
    if (summary.usable) WriteBack(is_outlier);
    return summary;
  }

 private:
  void WriteBack(const std::vector<uint8_t>& is_outlier) {
    for (size_t i = 0; i < keyframes_.size(); ++i) {
      if (!problem_.poses[i].fixed)
        map_->keyframes().At(keyframes_[i]).set_cam_from_world(problem_.poses[i].cam_from_world);
    }
    for (size_t i = 0; i < landmarks_.size(); ++i) {
      map_->landmarks().At(landmarks_[i]).set_position(problem_.points[i].position);
    }
    for (size_t i = 0; i < is_outlier.size(); ++i) {
      // The landmark may have gone with an earlier link.
      if (is_outlier[i] != 0 &&
          map_->keyframes().At(links_[i].keyframe).landmarks()[links_[i].keypoint].IsValid()) {
        map_->Unlink(links_[i].keyframe, links_[i].keypoint);
      }
    }
    for (const LandmarkId id : landmarks_) {
      if (map_->landmarks().Contains(id)) map_->RefreshLandmark(id);
    }
  }

  Map* map_;
  BundleProblem problem_;
  std::vector<uint32_t> pose_of_;  // by keyframe id
  std::vector<uint8_t> seen_;      // by landmark id
  std::vector<KeyframeId> keyframes_;
  std::vector<LandmarkId> landmarks_;
  std::vector<Observation> links_;  // of the problem's observations
};

}  // namespace

BundleSummary AdjustLocal(const Camera& camera, const MapperOptions& options, KeyframeId id, Map* map) {
  DS_TRACE("mapping/adjust");
  std::vector<KeyframeId> local{id};
  for (const CovisibleKeyframe& other :
       map->keyframes().At(id).BestCovisible(static_cast<size_t>(options.local_keyframes - 1))) {
    local.push_back(other.id);
  }
  MapBundle bundle(map);
  for (const KeyframeId keyframe : local) bundle.AddLandmarksOf(keyframe);

  std::vector<uint8_t> is_local(map->keyframes().CreatedCount(), 0);
  for (const KeyframeId keyframe : local) is_local[keyframe.value()] = 1;
  std::vector<int> seen_by(map->keyframes().CreatedCount(), 0);
  for (const LandmarkId landmark : bundle.landmarks()) {
    for (const Observation& observation : map->landmarks().At(landmark).observations()) {
      if (is_local[observation.keyframe.value()] == 0) ++seen_by[observation.keyframe.value()];
    }
  }
  std::vector<KeyframeId> fixed;
  for (uint32_t i = 0; i < seen_by.size(); ++i) {
    if (seen_by[i] > 0) fixed.emplace_back(i);
  }
  std::stable_sort(fixed.begin(), fixed.end(),
                   [&](KeyframeId a, KeyframeId b) { return seen_by[a.value()] > seen_by[b.value()]; });
  if (fixed.size() > static_cast<size_t>(options.fixed_keyframes)) {
    fixed.resize(static_cast<size_t>(options.fixed_keyframes));
  }
  // The first keyframe is the origin of the world. With fewer than two outside to hold the others, the oldest
  // does.
  const KeyframeId oldest = *std::min_element(local.begin(), local.end());
  const bool oldest_is_fixed = oldest == KeyframeId(0) || fixed.size() < 2;
  for (const KeyframeId keyframe : local) bundle.AddPose(keyframe, oldest_is_fixed && keyframe == oldest);
  for (const KeyframeId keyframe : fixed) bundle.AddPose(keyframe, true);
  return bundle.Solve(camera, options.local_bundle);
}

BundleSummary AdjustAll(const Camera& camera, const MapperOptions& options, Map* map) {
  DS_TRACE("mapping/adjust all");
  MapBundle bundle(map);
  bool first = true;
  map->keyframes().ForEach([&](const Keyframe& keyframe) {
    bundle.AddPose(keyframe.id(), first);
    bundle.AddLandmarksOf(keyframe.id());
    first = false;
  });
  return bundle.Solve(camera, options.final_bundle);
}

}  // namespace dynamic_slam
