#include "dynamic_slam/mapping/bundle_terms.h"

#include <algorithm>
#include <cmath>

#include "dynamic_slam/map/static_evidence.h"
#include "dynamic_slam/optimize/path_smoother.h"

namespace dynamic_slam {
namespace {

// Between images that are nearer in time nobody knows how fast a camera is.
constexpr double kMinStep_s = 1e-3;

// Of each pose but the first: the camera's orientation halfway to it, world from camera.
std::vector<Eigen::Matrix3d> StepOrientations(std::span<const StampedPose> shot) {
  std::vector<Eigen::Matrix3d> orientations(shot.size());
  for (size_t i = 1; i < shot.size(); ++i) {
    orientations[i] =
        shot[i - 1].world_from_cam.rotation.slerp(0.5, shot[i].world_from_cam.rotation).toRotationMatrix();
  }
  return orientations;
}

// The path of a camera that thinks that it never turns.
Trajectory Unrolled(std::span<const StampedPose> shot) {
  const std::vector<Eigen::Matrix3d> world_from_step = StepOrientations(shot);
  Trajectory unrolled(shot.begin(), shot.end());
  for (size_t i = 1; i < shot.size(); ++i) {
    const Eigen::Vector3d step = shot[i].world_from_cam.translation - shot[i - 1].world_from_cam.translation;
    unrolled[i].world_from_cam.translation =
        unrolled[i - 1].world_from_cam.translation + world_from_step[i].transpose() * step;
  }
  return unrolled;
}

}  // namespace

BundleProblem::Observation ObservationOf(const FrameView::Sighting& sighting, const Landmark& landmark,
                                         std::span<const float> octave_scales, uint32_t pose,
                                         uint32_t point) {
  const float sigma_px =
      sighting.sigma_px > 0 ? sighting.sigma_px : octave_scales[static_cast<size_t>(sighting.octave)];
  return {pose, point, sighting.ideal_px.cast<double>(), 1.0 / sigma_px,
          TrustInMatch(sighting.static_probability, landmark.static_log_odds)};
}

MotionNoise NoiseOf(std::span<const std::span<const StampedPose>> shots) {
  double in_world = 0, in_camera = 0;
  for (const std::span<const StampedPose> shot : shots) {
    in_world = std::max(in_world, AccelerationNoise(shot));
    in_camera = std::max(in_camera, AccelerationNoise(Unrolled(shot)));
  }
  return {std::min(in_world, in_camera), in_camera < in_world};
}

// Under white noise of acceleration the mean velocities over two steps differ by its density times a third of
// both, as variance (from the covariances in Bar-Shalom, Li, Kirubarajan 2001, 6.2.2).
void AppendMotions(std::span<const StampedPose> shot, std::span<const uint32_t> poses,
                   const MotionNoise& noise, std::vector<BundleProblem::Motion>* motions) {
  const std::vector<Eigen::Matrix3d> world_from_step = StepOrientations(shot);
  for (size_t i = 2; i < shot.size(); ++i) {
    BundleProblem::Motion motion;
    motion.poses = {poses[i - 2], poses[i - 1], poses[i]};
    motion.first_s = shot[i - 1].timestamp_s - shot[i - 2].timestamp_s;
    motion.second_s = shot[i].timestamp_s - shot[i - 1].timestamp_s;
    if (std::min(motion.first_s, motion.second_s) < kMinStep_s) continue;
    motion.inverse_sigma = 1 / std::sqrt(noise.density * (motion.first_s + motion.second_s) / 3);
    if (noise.is_in_camera) motion.turn = world_from_step[i] * world_from_step[i - 1].transpose();
    motions->push_back(motion);
  }
}

}  // namespace dynamic_slam
