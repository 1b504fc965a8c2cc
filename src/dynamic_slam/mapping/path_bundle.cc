#include "dynamic_slam/mapping/path_bundle.h"

#include <algorithm>
#include <map>
#include <span>
#include <unordered_map>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/optimize/path_smoother.h"

namespace dynamic_slam {
namespace {

// A path is adjusted so many poses at a time, and with as many more as tell how it goes on: a pose knows
// nothing of those that are a second away, where all see the map.
constexpr size_t kWindow = 150, kLookAhead = 50;

// Frames see the same landmarks, and err together. Poses that were found each for itself scatter by so many
// times what their keypoints alone would make them: fr1_desk 2.1, with people 2.3 and 2.4, redkitchen 1.7.
constexpr double kScatter = 2;

class PathBundle {
 public:
  PathBundle(const Camera& camera, const BundleOptions& options, const std::function<bool()>& should_stop,
             SharedMap* map)
      : camera_(camera), options_(options), should_stop_(should_stop), map_(map) {}

  // shot: of the path, without cuts; noise: of its motion.
  void Adjust(std::span<FrameView* const> shot, MotionNoise noise) const {
    noise.density /= kScatter * kScatter;
    for (size_t begin = 0; begin < shot.size(); begin += kWindow) {
      if (should_stop_ && should_stop_()) return;
      // Those before are done.
      const size_t fixed = std::min<size_t>(begin, 2);
      const size_t end = std::min(begin + kWindow + kLookAhead, shot.size());
      const auto window = shot.subspan(begin - fixed, end - begin + fixed);
      BundleProblem problem = ProblemOf(window, fixed, noise);
      if (problem.motions.empty() || problem.observations.empty()) continue;
      std::vector<uint8_t> is_outlier;
      if (!AdjustBundle(camera_, options_, should_stop_, &problem, &is_outlier).usable) continue;
      for (size_t i = fixed; i < std::min(fixed + kWindow, window.size()); ++i) {
        window[i]->cam_from_world = problem.poses[i].cam_from_world;
      }
    }
  }

 private:
  BundleProblem ProblemOf(std::span<FrameView* const> window, size_t fixed, const MotionNoise& noise) const {
    BundleProblem problem;
    Trajectory path;
    std::vector<uint32_t> poses;
    for (const FrameView* view : window) {
      poses.push_back(static_cast<uint32_t>(poses.size()));
      path.push_back({view->timestamp_s, view->cam_from_world.Inverse()});
      problem.poses.push_back({view->cam_from_world, poses.size() <= fixed});
    }
    AppendMotions(path, poses, noise, &problem.motions);

    const auto map = map_->Read();
    std::unordered_map<uint32_t, uint32_t> point_of;  // by landmark id
    for (size_t i = fixed; i < window.size(); ++i) {
      for (const FrameView::Sighting& sighting : window[i]->sightings) {
        const Landmark* landmark = map->landmarks().Find(sighting.landmark);
        if (landmark == nullptr) continue;
        const auto [point, is_new] =
            point_of.emplace(sighting.landmark.value(), static_cast<uint32_t>(problem.points.size()));
        if (is_new) problem.points.push_back({landmark->position(), true});
        problem.observations.push_back(
            ObservationOf(sighting, *landmark, map->octave_scales(), poses[i], point->second));
      }
    }
    return problem;
  }

  const Camera& camera_;
  const BundleOptions& options_;
  const std::function<bool()>& should_stop_;
  SharedMap* map_;
};

}  // namespace

void AdjustPath(const Camera& camera, const BundleOptions& options, const MotionNoises& noises,
                const std::function<bool()>& should_stop, SharedMap* map, std::vector<FrameView>* views) {
  DS_TRACE("mapping/adjust path");
  std::map<PartId, std::vector<FrameView*>> parts;
  for (FrameView& view : *views) parts[view.part].push_back(&view);
  const PathBundle bundle(camera, options, should_stop, map);
  for (const auto& [part, path] : parts) {
    Trajectory trajectory;
    for (const FrameView* view : path)
      trajectory.push_back({view->timestamp_s, view->cam_from_world.Inverse()});
    const auto shots = ShotsOf(trajectory);
    const auto known = noises.find(part);
    const MotionNoise noise = known != noises.end() ? known->second : NoiseOf(shots);
    if (!(noise.density > 0)) continue;
    size_t first = 0;
    for (const std::span<const StampedPose> shot : shots) {
      bundle.Adjust(std::span(path).subspan(first, shot.size()), noise);
      first += shot.size();
    }
  }
}

}  // namespace dynamic_slam
