#include "dynamic_slam/mapping/path_bundle.h"

#include <algorithm>
#include <map>
#include <optional>
#include <span>
#include <unordered_map>

#include <Eigen/Cholesky>

#include "dynamic_slam/base/percentile.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/optimize/path_smoother.h"
#include "dynamic_slam/optimize/reprojection_cost.h"

namespace dynamic_slam {
namespace {

// A path is adjusted so many poses at a time, and with as many more as tell how it goes on: a pose knows
// nothing of those that are a second away, where all see the map.
constexpr size_t kWindow = 150, kLookAhead = 50;

// Of what a view says of its pose: below it, that is nothing in some direction.
constexpr double kLeastCondition = 1e-12;

class PathBundle {
 public:
  PathBundle(const Camera& camera, const BundleOptions& options, const std::function<bool()>& should_stop,
             SharedMap* map)
      : camera_(camera), options_(options), should_stop_(should_stop), map_(map) {}

  // shot: of the path, without cuts, and where its poses are; noise: of its motion.
  void Adjust(std::span<FrameView* const> shot, std::span<const StampedPose> poses, MotionNoise noise) const {
    noise.density /= Scatter(shot, poses);
    for (size_t begin = 0; begin < shot.size(); begin += kWindow) {
      if (should_stop_ && should_stop_()) return;
      // Those before are done.
      const size_t fixed = std::min<size_t>(begin, 2);
      const size_t end = std::min(begin + kWindow + kLookAhead, shot.size());
      const auto window = shot.subspan(begin - fixed, end - begin + fixed);
      BundleProblem problem = ProblemOf(window, fixed, noise);
      const bool is_held = fixed > 0 || problem.points.size() >= kFewestPointsToHoldWorld;
      if (problem.motions.empty() || !is_held) continue;
      std::vector<uint8_t> is_outlier;
      if (!AdjustBundle(camera_, options_, should_stop_, &problem, &is_outlier).usable) continue;
      for (size_t i = fixed; i < std::min(fixed + kWindow, window.size()); ++i) {
        window[i]->cam_from_world = problem.poses[i].cam_from_world;
      }
    }
  }

 private:
  // How much the poses that were found each for itself scatter, over what their keypoints alone would make
  // them, as variances. Neighbours see the same landmarks, with the same errors: fr1_desk has 4, with people
  // 5 to 6, redkitchen 3. Less than 1 does not show beside the motion.
  double Scatter(std::span<FrameView* const> shot, std::span<const StampedPose> poses) const {
    const auto map = map_->Read();
    std::vector<double> expected;
    for (const FrameView* view : shot) {
      if (const std::optional<double> variance = VarianceOf(*view, *map)) expected.push_back(*variance);
    }
    if (expected.empty()) return 1;
    return std::max(1.0, PositionVariance(poses) / Percentile(0.5, &expected));
  }

  // Of the camera's position in each coordinate, by what the view sees of landmarks that are exact.
  std::optional<double> VarianceOf(const FrameView& view, const Map& map) const {
    Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
    for (const FrameView::Sighting& sighting : view.sightings) {
      const Landmark* landmark = map.landmarks().Find(sighting.landmark);
      if (landmark == nullptr) continue;
      const BundleProblem::Observation seen = ObservationOf(sighting, *landmark, map.octave_scales(), 0, 0);
      const Eigen::Vector3d x = view.cam_from_world * landmark->position();
      if (!(x.z() > kMinProjectionDepth)) continue;
      const Eigen::Vector2d error = seen.inverse_sigma_px * (camera_.Project(x) - seen.ideal_px);
      if (error.squaredNorm() > options_.chi2) continue;
      Eigen::Matrix<double, 2, 3> J_cam;  // of x
      J_cam << camera_.fx, 0, -camera_.fx * x.x() / x.z(), 0, camera_.fy, -camera_.fy * x.y() / x.z();
      J_cam *= seen.inverse_sigma_px / x.z();
      Eigen::Matrix<double, 2, 6> J;  // of x -> Exp(rotation) x + translation
      J << -J_cam * Skew(x), J_cam;
      information += seen.weight * J.transpose() * J;
    }
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> factor(information);
    if (!factor.isPositive() || factor.rcond() < kLeastCondition) return std::nullopt;
    // The centre moves as far as the translation, wherever the camera looks.
    const Eigen::Matrix<double, 6, 6> covariance = factor.solve(Eigen::Matrix<double, 6, 6>::Identity());
    return covariance.bottomRightCorner<3, 3>().trace() / 3;
  }

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
      bundle.Adjust(std::span(path).subspan(first, shot.size()), shot, noise);
      first += shot.size();
    }
  }
}

}  // namespace dynamic_slam
