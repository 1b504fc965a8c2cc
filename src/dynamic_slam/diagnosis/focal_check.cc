#include "dynamic_slam/diagnosis/focal_check.h"

#include <array>
#include <map>
#include <vector>

#include <ceres/ceres.h>

#include "dynamic_slam/optimize/reprojection_cost.h"
#include "dynamic_slam/system/sequence_runner.h"

namespace dynamic_slam {
namespace {

using PoseBlock = std::array<double, kPoseBlockSize>;

// Reprojection error in sigmas: of a pose, a point in world and the factor on the focal lengths.
struct FocalCost {
  Eigen::Vector2d focal_px, from_center_px;
  double inverse_sigma_px;

  template <class T>
  bool operator()(const T* pose, const T* point, const T* factor, T* residuals) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(pose);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(pose + 4), x_in_world(point);
    const Eigen::Matrix<T, 3, 1> x = q * x_in_world + t;
    if (x.z() < T(kMinProjectionDepth)) return false;
    for (int i = 0; i < 2; ++i) {
      residuals[i] = (*factor * focal_px[i] * x[i] / x.z() - from_center_px[i]) * inverse_sigma_px;
    }
    return true;
  }
};

}  // namespace

std::optional<FocalGuess> GuessFocalLength(const Camera& camera, const Map& map) {
  constexpr size_t kFewestKeyframes = 5, kMostKeyframes = 60, kFewestSightings = 3;
  std::map<KeyframeId, PoseBlock> poses;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != map.Parts().front() || poses.size() == kMostKeyframes) return;
    PoseBlock& block = poses[keyframe.id()];
    Eigen::Map<Eigen::Quaterniond>(block.data()) = keyframe.cam_from_world().rotation;
    Eigen::Map<Eigen::Vector3d>(block.data() + 4) = keyframe.cam_from_world().translation;
  });
  if (poses.size() < kFewestKeyframes) return std::nullopt;

  ceres::Problem problem;
  std::map<LandmarkId, Eigen::Vector3d> points;
  double factor = 1;
  map.landmarks().ForEach([&](const Landmark& landmark) {
    std::vector<Observation> seen;
    for (const Observation& observation : landmark.observations()) {
      if (poses.contains(observation.keyframe)) seen.push_back(observation);
    }
    if (seen.size() < kFewestSightings) return;
    double* point = (points[landmark.id()] = landmark.position()).data();
    for (const Observation& observation : seen) {
      const Keypoint& keypoint = map.keyframes().At(observation.keyframe).keypoint(observation.keypoint);
      const double sigma_px = map.octave_scales()[static_cast<size_t>(keypoint.octave)];
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<FocalCost, 2, kPoseBlockSize, 3, 1>(new FocalCost{
              {camera.fx, camera.fy}, {keypoint.x - camera.cx, keypoint.y - camera.cy}, 1 / sigma_px}),
          new ceres::HuberLoss(2), poses.at(observation.keyframe).data(), point, &factor);
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
  ceres::Solver::Summary with_own, with_best;
  problem.SetParameterBlockConstant(&factor);
  ceres::Solve(options, &problem, &with_own);
  problem.SetParameterBlockVariable(&factor);
  problem.SetParameterLowerBound(&factor, 0, 0.2);
  problem.SetParameterUpperBound(&factor, 0, 5);
  ceres::Solve(options, &problem, &with_best);
  if (!with_own.IsSolutionUsable() || !with_best.IsSolutionUsable()) return std::nullopt;
  return FocalGuess{factor, 1 - with_best.final_cost / with_own.final_cost};
}

std::optional<FocalGuess> GuessFocalLength(const Camera& camera, FrameSource* source) {
  SystemOptions options;
  options.backfill = false;
  SlamSystem system(camera, options);
  const RunSummary summary = RunSequence(*source, system);
  if (summary.failure != nullptr) std::rethrow_exception(summary.failure);
  const auto map = system.map().Read();
  if (map->Parts().empty()) return std::nullopt;
  return GuessFocalLength(system.camera(), *map);
}

}  // namespace dynamic_slam
