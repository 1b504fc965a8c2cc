#include "dynamic_slam/mapping/map_bundle.h"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/optimize/path_smoother.h"

namespace dynamic_slam {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// Landmarks that are refreshed before others may look at the map again.
constexpr size_t kRefreshedAtOnce = 100;

// A bundle problem made of parts of the map, and the way back.
class MapBundle {
 public:
  explicit MapBundle(const Map& map)
      : epoch_(map.epoch()),
        revision_(map.revision()),
        pose_of_(map.keyframes().CreatedCount(), kNone),
        point_of_(map.landmarks().CreatedCount(), kNone) {}

  // Of everything: all that others compute from the map meanwhile is out of date when it ends.
  void SetWhole() { is_whole_ = true; }

  void AddPose(const Map& map, KeyframeId id, bool fixed) {
    pose_of_[id.value()] = static_cast<uint32_t>(problem_.poses.size());
    problem_.poses.push_back({map.keyframes().At(id).cam_from_world(), fixed});
    keyframes_.push_back(id);
  }

  void AddLandmarksOf(const Map& map, KeyframeId id) {
    map.keyframes().At(id).ForEachLandmark([&](uint32_t, LandmarkId landmark) {
      uint32_t& point = point_of_[landmark.value()];
      if (point != kNone) return;
      point = static_cast<uint32_t>(landmarks_.size());
      landmarks_.push_back(landmark);
    });
  }
  const std::vector<LandmarkId>& landmarks() const { return landmarks_; }

  // After all poses and landmarks: what the ones see of the others. aligned: may be null.
  void AddObservations(const Map& map, const AlignedKeypoints* aligned = nullptr) {
    for (const LandmarkId id : landmarks_) {
      const Landmark& landmark = map.landmarks().At(id);
      problem_.points.push_back({landmark.position(), false});
      for (const Observation& observation : landmark.observations()) {
        if (!HasPose(observation.keyframe)) continue;
        const Keyframe& keyframe = map.keyframes().At(observation.keyframe);
        const Keypoint& keypoint = keyframe.keypoint(observation.keypoint);
        FrameView::Sighting sighting{
            id, {keypoint.x, keypoint.y}, keypoint.octave, keyframe.StaticProbability(observation.keypoint)};
        if (aligned != nullptr) Sharpen(*aligned, observation, &sighting);
        Observe(map, landmark, pose_of_[observation.keyframe.value()], sighting);
        links_.push_back({observation, id});
      }
    }
  }

  // After them.
  void AddViews(const Map& map, std::span<const FrameView> views) {
    for (const FrameView& view : views) {
      const uint32_t pose = static_cast<uint32_t>(problem_.poses.size());
      problem_.poses.push_back({view.cam_from_world, false});
      AddToPath(view.part, view.timestamp_s, pose);
      for (const FrameView::Sighting& sighting : view.sightings) {
        const Landmark* landmark = map.landmarks().Find(sighting.landmark);
        if (landmark != nullptr) Observe(map, *landmark, pose, sighting);
      }
    }
  }

  // After all poses: how those of this run follow each other, as what carries a camera has mass. noise: of
  // each part of the map; of those that it lacks it is measured.
  void AddMotions(const Map& map, MotionNoises* noise) {
    for (size_t i = 0; i < keyframes_.size(); ++i) {
      const Keyframe& keyframe = map.keyframes().At(keyframes_[i]);
      const bool is_from_file = !keyframe.frame_id().IsValid();
      if (!is_from_file) AddToPath(keyframe.part(), keyframe.timestamp_s(), static_cast<uint32_t>(i));
    }
    for (const auto& [part, path] : paths_) {
      Trajectory trajectory;
      std::vector<uint32_t> poses;
      for (const auto& [stamp, pose] : path) {
        trajectory.push_back({stamp, problem_.poses[pose].cam_from_world.Inverse()});
        poses.push_back(pose);
      }
      const auto shots = ShotsOf(trajectory);
      MotionNoise& of_part = (*noise)[part];
      if (of_part.density == 0) of_part = NoiseOf(shots);
      if (!(of_part.density > 0) || !HoldScale(map, part)) continue;
      size_t first = 0;
      for (const std::span<const StampedPose> shot : shots) {
        AppendMotions(shot, std::span(poses).subspan(first, shot.size()), of_part, &problem_.motions);
        first += shot.size();
      }
    }
  }

  BundleSummary Solve(const Camera& camera, const BundleOptions& options,
                      const std::function<bool()>& should_stop) {
    return AdjustBundle(camera, options, should_stop, &problem_, &is_outlier_);
  }

  // False, and nothing is changed, when this is not the map any more that the problem was made of. Poses and
  // points move all at once; what follows from that, landmark by landmark, leaves room for others.
  bool WriteBack(SharedMap* map) const {
    if (!Move(map->Write().get())) return false;
    DS_TRACE("mapping/refresh");
    size_t link = 0;
    for (size_t i = 0; i < landmarks_.size();) {
      const auto locked = map->Write();
      if (locked->epoch() != epoch_) break;
      for (const size_t end = std::min(i + kRefreshedAtOnce, landmarks_.size()); i < end; ++i) {
        for (; link < links_.size() && links_[link].landmark == landmarks_[i]; ++link) {
          if (is_outlier_[link] != 0) Unlink(links_[link], locked.get());
        }
        if (locked->landmarks().Contains(landmarks_[i])) locked->RefreshLandmark(landmarks_[i]);
      }
    }
    return true;
  }

 private:
  // A part may shrink without a change of what is seen of it, and slower motion is more probable: a landmark
  // of its origin holds its scale. False if there is none.
  bool HoldScale(const Map& map, PartId part) {
    const Landmark* best = nullptr;
    for (const KeyframeId id : keyframes_) {
      const Keyframe& keyframe = map.keyframes().At(id);
      if (keyframe.part() != part || !map.IsOrigin(id)) continue;
      keyframe.ForEachLandmark([&](uint32_t, LandmarkId seen) {
        const Landmark& landmark = map.landmarks().At(seen);
        if (best == nullptr || landmark.observations().size() > best->observations().size()) best = &landmark;
      });
    }
    if (best != nullptr) problem_.points[point_of_[best->id().value()]].fixed = true;
    return best != nullptr;
  }

  static void Sharpen(const AlignedKeypoints& aligned, const Observation& observation,
                      FrameView::Sighting* sighting) {
    const auto of_keyframe = aligned.find(observation.keyframe);
    if (of_keyframe == aligned.end()) return;
    const AlignedKeypoint& keypoint = of_keyframe->second[observation.keypoint];
    if (!(keypoint.sigma_px > 0)) return;
    sighting->ideal_px = keypoint.ideal_px;
    sighting->sigma_px = keypoint.sigma_px;
  }

  void AddToPath(PartId part, double timestamp_s, uint32_t pose) { paths_[part].emplace(timestamp_s, pose); }

  void Observe(const Map& map, const Landmark& landmark, uint32_t pose, const FrameView::Sighting& sighting) {
    problem_.observations.push_back(
        ObservationOf(sighting, landmark, map.octave_scales(), pose, point_of_[landmark.id().value()]));
  }

  // Of the problem's first observations, those of a landmark one after the other.
  struct Link {
    Observation observation;
    LandmarkId landmark;
  };

  bool Move(Map* map) const {
    if (map->epoch() != epoch_ || map->revision() != revision_) return false;
    if (is_whole_) map->BeginRevision();
    const std::vector<Younger> younger = YoungerLandmarks(*map);
    MoveYoungerKeyframes(map);
    for (size_t i = 0; i < keyframes_.size(); ++i) {
      if (problem_.poses[i].fixed) continue;
      if (Keyframe* keyframe = map->keyframes().Find(keyframes_[i])) {
        keyframe->set_cam_from_world(problem_.poses[i].cam_from_world);
      }
    }
    for (const Younger& one : younger) {
      const Rigid3 world_from_keyframe = map->keyframes().At(one.seen_by).cam_from_world().Inverse();
      map->landmarks().At(one.id).Transform(ToSim3(world_from_keyframe * one.keyframe_from_world));
    }
    for (size_t i = 0; i < landmarks_.size(); ++i) {
      if (Landmark* landmark = map->landmarks().Find(landmarks_[i])) {
        landmark->set_position(problem_.points[i].position);
      }
    }
    return true;
  }

  // A landmark that came during the solution keeps its place relative to a keyframe that sees it.
  struct Younger {
    LandmarkId id;
    KeyframeId seen_by;
    Rigid3 keyframe_from_world;  // before anything moved
  };

  std::vector<Younger> YoungerLandmarks(const Map& map) const {
    std::vector<Younger> younger;
    for (uint32_t id = static_cast<uint32_t>(point_of_.size()); id < map.landmarks().CreatedCount(); ++id) {
      const Landmark* landmark = map.landmarks().Find(LandmarkId(id));
      if (landmark == nullptr || landmark->observations().empty()) continue;
      const KeyframeId seen_by = landmark->observations().back().keyframe;
      younger.push_back({landmark->id(), seen_by, map.keyframes().At(seen_by).cam_from_world()});
    }
    return younger;
  }

  // The link may have gone with an earlier one of its landmark, or by others.
  static void Unlink(const Link& link, Map* map) {
    const Keyframe* keyframe = map->keyframes().Find(link.observation.keyframe);
    if (keyframe != nullptr && keyframe->landmarks()[link.observation.keypoint] == link.landmark) {
      map->Unlink(link.observation.keyframe, link.observation.keypoint);
    }
  }

  bool HasPose(KeyframeId id) const { return id.value() < pose_of_.size() && pose_of_[id.value()] != kNone; }

  // Keyframes that came during the solution keep their place relative to the one they share most with.
  void MoveYoungerKeyframes(Map* map) const {
    map->keyframes().ForEach([this, map](Keyframe& keyframe) {
      if (keyframe.id().value() < pose_of_.size()) return;
      for (const CovisibleKeyframe& other : keyframe.BestCovisible(keyframe.covisible().size())) {
        if (!HasPose(other.id)) continue;
        const BundleProblem::Pose& moved = problem_.poses[pose_of_[other.id.value()]];
        keyframe.set_cam_from_world(keyframe.cam_from_world() *
                                    map->keyframes().At(other.id).cam_from_world().Inverse() *
                                    moved.cam_from_world);
        return;
      }
    });
  }

  uint32_t epoch_, revision_;
  bool is_whole_ = false;
  BundleProblem problem_;
  std::vector<uint8_t> is_outlier_;
  std::vector<uint32_t> pose_of_;   // by keyframe id
  std::vector<uint32_t> point_of_;  // by landmark id
  std::vector<KeyframeId> keyframes_;
  std::vector<LandmarkId> landmarks_;
  std::vector<Link> links_;
  std::map<PartId, std::map<double, uint32_t>> paths_;  // by time
};

MapBundle LocalBundle(const MapperOptions& options, KeyframeId id, const Map& map) {
  std::vector<KeyframeId> local{id};
  for (const CovisibleKeyframe& other :
       map.keyframes().At(id).BestCovisible(static_cast<size_t>(options.local_keyframes - 1))) {
    local.push_back(other.id);
  }
  MapBundle bundle(map);
  for (const KeyframeId keyframe : local) bundle.AddLandmarksOf(map, keyframe);

  std::vector<uint8_t> is_local(map.keyframes().CreatedCount(), 0);
  for (const KeyframeId keyframe : local) is_local[keyframe.value()] = 1;
  std::vector<int> seen_by(map.keyframes().CreatedCount(), 0);
  for (const LandmarkId landmark : bundle.landmarks()) {
    for (const Observation& observation : map.landmarks().At(landmark).observations()) {
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
  // With fewer than two outside to hold the others, the oldest does.
  const KeyframeId oldest = *std::min_element(local.begin(), local.end());
  const bool oldest_is_fixed = map.IsOrigin(oldest) || fixed.size() < 2;
  for (const KeyframeId keyframe : local) {
    bundle.AddPose(map, keyframe, oldest_is_fixed && keyframe == oldest);
  }
  for (const KeyframeId keyframe : fixed) bundle.AddPose(map, keyframe, true);
  bundle.AddObservations(map);
  return bundle;
}

MapBundle WholeBundle(const Map& map, const AlignedKeypoints* aligned) {
  MapBundle bundle(map);
  bundle.SetWhole();
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    bundle.AddPose(map, keyframe.id(), map.IsOrigin(keyframe.id()));
    bundle.AddLandmarksOf(map, keyframe.id());
  });
  bundle.AddObservations(map, aligned);
  return bundle;
}

BundleSummary SolveAndWriteBack(const Camera& camera, const BundleOptions& options,
                                const std::function<bool()>& should_stop, MapBundle* bundle, SharedMap* map) {
  BundleSummary summary = bundle->Solve(camera, options, should_stop);
  summary.usable = summary.usable && bundle->WriteBack(map);
  return summary;
}

}  // namespace

BundleSummary AdjustLocal(const Camera& camera, const MapperOptions& options, KeyframeId id, uint32_t epoch,
                          const std::function<bool()>& should_stop, SharedMap* map) {
  DS_TRACE("mapping/adjust");
  std::optional<MapBundle> bundle;
  {
    const auto locked = map->Read();
    if (locked->epoch() != epoch || locked->keyframes().size() < 2) return {};
    bundle = LocalBundle(options, id, *locked);
  }
  return SolveAndWriteBack(camera, options.local_bundle, should_stop, &*bundle, map);
}

BundleSummary AdjustAll(const Camera& camera, const MapperOptions& options,
                        const std::function<bool()>& should_stop, SharedMap* map, const PathEvidence* path) {
  DS_TRACE("mapping/adjust all");
  std::optional<MapBundle> bundle;
  {
    const auto locked = map->Read();
    if (locked->keyframes().size() < 2) return {};
    bundle = WholeBundle(*locked, path != nullptr ? &path->aligned : nullptr);
    if (path != nullptr) {
      bundle->AddViews(*locked, path->views);
      if (options.motion_prior) bundle->AddMotions(*locked, path->noise);
    }
  }
  return SolveAndWriteBack(camera, options.final_bundle, should_stop, &*bundle, map);
}

}  // namespace dynamic_slam
