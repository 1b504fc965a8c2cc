#include "dynamic_slam/mapping/local_mapper.h"

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/mapping/landmark_fusion.h"
#include "dynamic_slam/mapping/map_bundle.h"

namespace dynamic_slam {
namespace {

// A new landmark is on probation for so many keyframes: tracking must find it in a quarter of the frames
// where it should be visible, and after two keyframes a third must have seen it (Mur-Artal et al. 2015,
// section VI-B).
constexpr uint32_t kProbationKeyframes = 3;
constexpr double kMinFoundRatio = 0.25;
constexpr size_t kMinObservations = 3;

// Other keyframes that must see a landmark at the same or a finer scale for it to count as redundant.
constexpr int kRedundantViews = 3;

}  // namespace

LocalMapper::LocalMapper(const Camera& camera, const MapperOptions& options, Map* map)
    : camera_(camera), options_(options), map_(map), factory_(camera, options) {}

MappingResult LocalMapper::Process(KeyframeId keyframe) {
  DS_TRACE("mapping");
  MappingResult result;
  result.culled_landmarks = CullRecentLandmarks(keyframe);
  const std::vector<LandmarkId> created = factory_.Create(keyframe, map_);
  recent_landmarks_.insert(recent_landmarks_.end(), created.begin(), created.end());
  result.created = static_cast<int>(created.size());
  result.merged_landmarks = FuseLandmarks(camera_, options_, keyframe, map_).merged;
  if (map_->keyframes().size() >= 2) result.bundle = AdjustLocal(camera_, options_, keyframe, map_);
  result.culled_keyframes = CullRedundantKeyframes(keyframe);
  return result;
}

BundleSummary LocalMapper::Finish() {
  return map_->keyframes().size() < 2 ? BundleSummary() : AdjustAll(camera_, options_, map_);
}

int LocalMapper::CullRecentLandmarks(KeyframeId current) {
  DS_TRACE("mapping/cull landmarks");
  int culled = 0;
  size_t kept = 0;
  for (const LandmarkId id : recent_landmarks_) {
    const Landmark* landmark = map_->landmarks().Find(id);
    if (landmark == nullptr) continue;
    const uint32_t age = current.value() - landmark->created_by().value();
    const bool unseen = age >= 2 && landmark->observations().size() < kMinObservations;
    if (landmark->FoundRatio() < kMinFoundRatio || unseen) {
      map_->EraseLandmark(id);
      ++culled;
    } else if (age < kProbationKeyframes) {
      recent_landmarks_[kept++] = id;
    }
  }
  recent_landmarks_.resize(kept);
  return culled;
}

int LocalMapper::CullRedundantKeyframes(KeyframeId current) {
  DS_TRACE("mapping/cull keyframes");
  int culled = 0;
  const std::vector<CovisibleKeyframe> neighbours =
      map_->keyframes().At(current).BestCovisible(map_->keyframes().size());
  for (const CovisibleKeyframe& neighbour : neighbours) {
    const Keyframe& keyframe = map_->keyframes().At(neighbour.id);
    if (keyframe.id().value() == 0) continue;  // the origin of the world
    int landmarks = 0, redundant = 0;
    for (uint32_t i = 0; i < keyframe.landmarks().size(); ++i) {
      if (!keyframe.landmarks()[i].IsValid()) continue;
      ++landmarks;
      int views = 0;
      for (const Observation& other : map_->landmarks().At(keyframe.landmarks()[i]).observations()) {
        if (other.keyframe == keyframe.id()) continue;
        views += map_->keyframes().At(other.keyframe).keypoint(other.keypoint).octave <=
                 keyframe.keypoint(i).octave + 1;
      }
      redundant += views >= kRedundantViews;
    }
    if (landmarks > 0 && redundant > options_.redundant_ratio * landmarks) {
      map_->EraseKeyframe(keyframe.id(), keyframe.BestCovisible(1).front().id);
      ++culled;
    }
  }
  return culled;
}

}  // namespace dynamic_slam
