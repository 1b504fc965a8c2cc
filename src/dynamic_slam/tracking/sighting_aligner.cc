#include "dynamic_slam/tracking/sighting_aligner.h"

#include <algorithm>
#include <cmath>

#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {
namespace {

// Standard deviation of where a patch of octave 0 is found, px: what is left when a map is adjusted to it is
// 0.2 px on a road and 0.5 where rows are read one after the other and people stand about. Coarser ones err
// by more, but not by as much as their pixels are larger.
constexpr float kSigma_px = 0.3f, kSigmaPower = 0.3f;

// Of the patch that is drawn to see how the view changes it, px.
constexpr double kTangent_px = 4;

}  // namespace

SightingAligner::SightingAligner(const Camera& camera, SharedMap* map)
    : camera_(camera),
      map_(map),
      octave_scales_(map->Read()->octave_scales()),
      grey_(camera.height, camera.width, CV_8UC1),
      pyramid_({camera.width, camera.height}, static_cast<int>(octave_scales_.size()),
               octave_scales_.size() > 1 ? octave_scales_[1] : 2) {}

bool SightingAligner::Load(double timestamp_s) {
  if (!images_.Read(timestamp_s, &grey_)) return false;
  pyramid_.Build(grey_);
  return true;
}

AlignedKeypoints SightingAligner::Align(const Motions& motions, const std::function<bool()>& should_stop,
                                        std::vector<FrameView>* views) {
  AlignViews(motions, should_stop, views);
  AlignedKeypoints aligned;
  const auto map = map_->Read();
  map->keyframes().ForEach([&](const Keyframe& keyframe) {
    if ((should_stop && should_stop()) || !keyframe.frame_id().IsValid()) return;
    if (!Load(keyframe.timestamp_s())) return;
    const View view = ViewOf(motions, keyframe.part(), keyframe.timestamp_s(), keyframe.cam_from_world());
    std::vector<AlignedKeypoint>& of_keyframe = aligned[keyframe.id()];
    of_keyframe.resize(keyframe.features().size());
    keyframe.ForEachLandmark([&](uint32_t i, LandmarkId landmark) {
      const Keypoint& keypoint = keyframe.keypoint(i);
      FrameView::Sighting sighting{landmark, {keypoint.x, keypoint.y}, keypoint.octave};
      sighting.raw_px = {keypoint.raw_x, keypoint.raw_y};
      const auto reference = references_.find(landmark.value());
      const bool is_reference = reference != references_.end() &&
                                reference->second.observation.keyframe == keyframe.id() &&
                                reference->second.observation.keypoint == i;
      if (is_reference) {
        Place(view, map->landmarks().At(landmark).position(), sighting.raw_px, &sighting);
        of_keyframe[i] = {sighting.ideal_px, SigmaOf(reference->second)};
      } else if (AlignSighting(*map, view, &sighting)) {
        of_keyframe[i] = {sighting.ideal_px, sighting.sigma_px};
      }
    });
  });
  return aligned;
}

void SightingAligner::AlignViews(const Motions& motions, const std::function<bool()>& should_stop,
                                 std::vector<FrameView>* views) {
  DS_TRACE("align");
  const auto map = map_->Read();
  ChooseReferences(*map);
  for (FrameView& view : *views) {
    if (should_stop && should_stop()) return;
    if (!Load(view.timestamp_s)) continue;
    const View seen = ViewOf(motions, view.part, view.timestamp_s, view.cam_from_world);
    for (FrameView::Sighting& sighting : view.sightings) AlignSighting(*map, seen, &sighting);
  }
}

SightingAligner::View SightingAligner::ViewOf(const Motions& motions, PartId part, double timestamp_s,
                                              const Rigid3& cam_from_world) const {
  const auto of_part = motions.find(part);
  if (of_part == motions.end()) return {cam_from_world, {}};
  const auto motion = of_part->second.find(timestamp_s);
  return {cam_from_world, motion != of_part->second.end() ? std::optional(motion->second) : std::nullopt};
}

// Of the keyframes that see a landmark the middle one in time: others show it from no more than half of the
// way.
void SightingAligner::ChooseReferences(const Map& map) {
  references_.clear();
  std::map<double, std::vector<std::pair<LandmarkId, Observation>>> of_images;
  std::vector<std::pair<double, Observation>> seen;
  map.landmarks().ForEach([&](const Landmark& landmark) {
    seen.clear();
    for (const Observation& observation : landmark.observations()) {
      const Keyframe& keyframe = map.keyframes().At(observation.keyframe);
      if (keyframe.frame_id().IsValid() && images_.Contains(keyframe.timestamp_s()))
        seen.emplace_back(keyframe.timestamp_s(), observation);
    }
    if (seen.empty()) return;
    const auto middle = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() / 2);
    std::nth_element(seen.begin(), middle, seen.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    of_images[middle->first].emplace_back(landmark.id(), middle->second);
  });
  for (const auto& [stamp, landmarks] : of_images) {
    if (!Load(stamp)) continue;
    for (const auto& [landmark, observation] : landmarks) {
      const Keypoint& keypoint = map.keyframes().At(observation.keyframe).keypoint(observation.keypoint);
      const auto octave = static_cast<uint32_t>(keypoint.octave);
      const ImagePyramid::Level& level = pyramid_[octave];
      const std::optional<Patch> patch =
          CutPatch(level.image, level.FromFull({keypoint.raw_x, keypoint.raw_y}));
      if (patch.has_value()) references_.emplace(landmark.value(), Reference{observation, octave, *patch});
    }
  }
}

bool SightingAligner::AlignSighting(const Map& map, const View& view, FrameView::Sighting* sighting) const {
  const auto found = references_.find(sighting->landmark.value());
  const Landmark* landmark = map.landmarks().Find(sighting->landmark);
  if (found == references_.end() || landmark == nullptr) return false;
  const Reference& reference = found->second;
  const Rigid3& reference_from_world = map.keyframes().At(reference.observation.keyframe).cam_from_world();
  const Rigid3 cam_from_reference = view.cam_from_world * reference_from_world.Inverse();
  const Eigen::Vector3d x = reference_from_world * landmark->position();
  if (!(x.z() > 0) || !((cam_from_reference * x).z() > 0)) return false;

  // A surface that faces the reference.
  const auto project = [&](double right_px, double down_px) {
    const Eigen::Vector3d along(right_px / camera_.fx, down_px / camera_.fy, 0);
    return camera_.Project(cam_from_reference * (x + x.z() * along));
  };
  const Eigen::Vector2d center = project(0, 0);
  Eigen::Matrix2d image_from_patch;  // px of the finest level for each px of the patch
  image_from_patch << project(kTangent_px, 0) - center, project(0, kTangent_px) - center;
  image_from_patch *= octave_scales_[reference.octave] / kTangent_px;
  const double scale = std::sqrt(std::abs(image_from_patch.determinant()));
  // In the level whose pixels are as large as the patch's.
  size_t nearest = 0;
  const auto ratio = [&](size_t octave) { return std::abs(std::log(scale / octave_scales_[octave])); };
  for (size_t i = 1; i < octave_scales_.size(); ++i) {
    if (ratio(i) < ratio(nearest)) nearest = i;
  }
  const ImagePyramid::Level& level = pyramid_[nearest];
  Eigen::Matrix2f level_from_patch = image_from_patch.cast<float>();
  level_from_patch.row(0) /= level.scale_x;
  level_from_patch.row(1) /= level.scale_y;

  const std::optional<Eigen::Vector2f> at =
      AlignPatch(reference.patch, level.image, level_from_patch, level.FromFull(sighting->raw_px));
  if (!at.has_value()) return false;
  Place(view, landmark->position(), level.ToFull(*at), sighting);
  sighting->sigma_px = SigmaOf(reference);
  return true;
}

void SightingAligner::Place(const View& view, const Eigen::Vector3d& x_in_world,
                            const Eigen::Vector2f& raw_px, FrameView::Sighting* sighting) const {
  const Eigen::Vector2d read_px = camera_.Undistort(raw_px.cast<double>());
  if (view.motion.has_value()) {
    const double depth = (view.cam_from_world * x_in_world).z();
    sighting->ideal_px = AtMiddleRow(camera_, *view.motion, read_px, raw_px.y(), 1 / depth).cast<float>();
  } else {
    // As much as the raw pixel moves; what a rolling shutter added stays.
    sighting->ideal_px += (read_px - camera_.Undistort(sighting->raw_px.cast<double>())).cast<float>();
  }
  sighting->raw_px = raw_px;
}

float SightingAligner::SigmaOf(const Reference& reference) const {
  return kSigma_px * std::pow(octave_scales_[reference.octave], kSigmaPower);
}

}  // namespace dynamic_slam
