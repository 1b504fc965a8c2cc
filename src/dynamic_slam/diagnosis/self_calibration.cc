#include "dynamic_slam/diagnosis/self_calibration.h"

#include <algorithm>
#include <array>
#include <map>
#include <vector>

#include <ceres/ceres.h>

#include "dynamic_slam/geometry/rolling_shutter.h"
#include "dynamic_slam/optimize/reprojection_cost.h"
#include "dynamic_slam/system/sequence_runner.h"

namespace dynamic_slam {
namespace {

using PoseBlock = std::array<double, kPoseBlockSize>;

// Reprojection error in sigmas: of a pose, a point in world, the factor on the focal lengths, what is to be
// added to the readout and to the lens's k1 and k2.
struct CalibrationCost {
  Eigen::Vector2d focal_px, from_center_px;
  Eigen::Vector2d row_flow_px;  // by which the keypoint goes back for each second of readout
  double inverse_sigma_px;

  template <class T>
  bool operator()(const T* pose, const T* point, const T* factor, const T* readout_s, const T* lens,
                  T* residuals) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(pose);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(pose + 4), x_in_world(point);
    const Eigen::Matrix<T, 3, 1> x = q * x_in_world + t;
    if (x.z() < T(kMinProjectionDepth)) return false;
    const T tangent2 = (x.x() * x.x() + x.y() * x.y()) / (x.z() * x.z());
    const T stretch = *factor * (T(1) + tangent2 * (lens[0] + tangent2 * lens[1]));
    for (int i = 0; i < 2; ++i) {
      const T seen = from_center_px[i] - *readout_s * row_flow_px[i];
      residuals[i] = (stretch * focal_px[i] * x[i] / x.z() - seen) * inverse_sigma_px;
    }
    return true;
  }
};

// How the camera moved about a stamp, if there are frames before and after it and none is missing.
std::optional<SteadyMotion> MotionAt(const Trajectory& frames, double timestamp_s) {
  constexpr double kMostBetween_s = 0.25;  // of the frames before and after: the motion may change
  const auto at =
      std::lower_bound(frames.begin(), frames.end(), timestamp_s,
                       [](const StampedPose& pose, double stamp_s) { return pose.timestamp_s < stamp_s; });
  if (at == frames.begin() || at == frames.end() || at + 1 == frames.end()) return std::nullopt;
  const StampedPose &before = *(at - 1), &after = *(at + 1);
  const double dt_s = after.timestamp_s - before.timestamp_s;
  if (at->timestamp_s != timestamp_s || !(dt_s > 0) || dt_s > kMostBetween_s) return std::nullopt;
  return MotionBetween(after.world_from_cam.Inverse() * before.world_from_cam, dt_s);
}

// Where the keypoint of a landmark goes for each second that the readout is longer, px.
Eigen::Vector2d RowFlow(const Camera& camera, const Keyframe& keyframe, const Keypoint& keypoint,
                        const Eigen::Vector3d& x_in_world, const std::optional<SteadyMotion>& motion) {
  const double depth = (keyframe.cam_from_world() * x_in_world).z();
  if (!motion.has_value() || depth < kMinProjectionDepth) return Eigen::Vector2d::Zero();
  constexpr double kStep_s = 1e-3;
  Camera rolling = camera;
  rolling.readout_s = kStep_s;
  const Eigen::Vector2d px(keypoint.x, keypoint.y);
  return (px - AtMiddleRow(rolling, *motion, px, keypoint.raw_y, 1 / depth)) / kStep_s;
}

}  // namespace

std::optional<SelfCalibration> CalibrateByMap(const Camera& camera, const Map& map,
                                              const Trajectory& frames) {
  constexpr size_t kFewestKeyframes = 5, kMostKeyframes = 120, kFewestSightings = 3;
  std::map<KeyframeId, PoseBlock> poses;
  std::map<KeyframeId, std::optional<SteadyMotion>> motions;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != map.Parts().front() || poses.size() == kMostKeyframes) return;
    motions[keyframe.id()] = MotionAt(frames, keyframe.timestamp_s());
    PoseBlock& block = poses[keyframe.id()];
    Eigen::Map<Eigen::Quaterniond>(block.data()) = keyframe.cam_from_world().rotation;
    Eigen::Map<Eigen::Vector3d>(block.data() + 4) = keyframe.cam_from_world().translation;
  });
  if (poses.size() < kFewestKeyframes) return std::nullopt;

  ceres::Problem problem;
  std::map<LandmarkId, Eigen::Vector3d> points;
  double factor = 1, more_readout_s = 0;
  std::array<double, 2> lens{};
  map.landmarks().ForEach([&](const Landmark& landmark) {
    std::vector<Observation> seen;
    for (const Observation& observation : landmark.observations()) {
      if (poses.contains(observation.keyframe)) seen.push_back(observation);
    }
    if (seen.size() < kFewestSightings) return;
    double* point = (points[landmark.id()] = landmark.position()).data();
    for (const Observation& observation : seen) {
      const Keyframe& keyframe = map.keyframes().At(observation.keyframe);
      const Keypoint& keypoint = keyframe.keypoint(observation.keypoint);
      const double sigma_px = map.octave_scales()[static_cast<size_t>(keypoint.octave)];
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<CalibrationCost, 2, kPoseBlockSize, 3, 1, 1, 2>(new CalibrationCost{
              {camera.fx, camera.fy},
              {keypoint.x - camera.cx, keypoint.y - camera.cy},
              RowFlow(camera, keyframe, keypoint, landmark.position(), motions.at(observation.keyframe)),
              1 / sigma_px}),
          new ceres::HuberLoss(2), poses.at(observation.keyframe).data(), point, &factor, &more_readout_s,
          lens.data());
    }
  });
  if (points.empty()) return std::nullopt;
  for (auto& [id, block] : poses) {
    if (problem.HasParameterBlock(block.data())) problem.SetManifold(block.data(), new PoseManifold);
  }
  double* const origin = poses.begin()->second.data();
  if (problem.HasParameterBlock(origin)) problem.SetParameterBlockConstant(origin);

  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = 50;
  options.logging_type = ceres::SILENT;
  const auto solve = [&](double* free) -> std::optional<double> {
    if (free != nullptr) problem.SetParameterBlockVariable(free);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (free != nullptr) problem.SetParameterBlockConstant(free);
    return summary.IsSolutionUsable() ? std::optional(summary.final_cost) : std::nullopt;
  };
  problem.SetParameterLowerBound(&factor, 0, 0.2);
  problem.SetParameterUpperBound(&factor, 0, 5);
  problem.SetParameterLowerBound(&more_readout_s, 0, -camera.readout_s);
  problem.SetParameterUpperBound(&more_readout_s, 0, Camera::kMaxReadout_s - camera.readout_s);
  problem.SetParameterBlockConstant(&factor);
  problem.SetParameterBlockConstant(&more_readout_s);
  problem.SetParameterBlockConstant(lens.data());
  const std::optional<double> with_own = solve(nullptr), with_readout = solve(&more_readout_s);
  SelfCalibration found{.readout_s = camera.readout_s + more_readout_s};
  more_readout_s = 0;
  const bool has_lens = camera.model == LensModel::kRadialTangential;
  const std::optional<double> with_lens = has_lens ? solve(lens.data()) : with_own;
  found.k1 = camera.k1 + lens[0];
  found.k2 = camera.k2 + lens[1];
  lens = {};
  const std::optional<double> with_focal = solve(&factor);
  if (!with_own || !with_readout || !with_lens || !with_focal) return std::nullopt;
  found.focal_factor = factor;
  found.focal_gain = 1 - *with_focal / *with_own;
  found.readout_gain = 1 - *with_readout / *with_own;
  found.lens_gain = 1 - *with_lens / *with_own;
  return found;
}

std::optional<SelfCalibration> CalibrateByMap(const Camera& camera, FrameSource* source) {
  SystemOptions options;
  options.backfill = false;
  options.align_sightings = false;  // the keypoints are what is looked at
  SlamSystem system(camera, options);
  const RunSummary summary = RunSequence(*source, system);
  if (summary.failure != nullptr) std::rethrow_exception(summary.failure);
  const Trajectory frames = system.FrameTrajectory();
  const auto map = system.map().Read();
  if (map->Parts().empty()) return std::nullopt;
  return CalibrateByMap(system.camera(), *map, frames);
}

}  // namespace dynamic_slam
