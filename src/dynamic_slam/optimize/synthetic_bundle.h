#pragma once

#include <vector>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/optimize/bundle_adjustment.h"
#include "dynamic_slam/optimize/pose_optimizer.h"

namespace dynamic_slam {

// Scenes with known truth for the tests and benchmarks of this folder.

inline Camera SyntheticCamera() {
  Camera camera;
  camera.name = "synthetic";
  camera.width = 640;
  camera.height = 480;
  camera.fx = 520;
  camera.fy = 515;
  camera.cx = 321;
  camera.cy = 243;
  return camera;
}

inline Eigen::Vector3d GaussianVector(Random* random, double sigma) {
  const double x = random->Gaussian(), y = random->Gaussian(), z = random->Gaussian();
  return sigma * Eigen::Vector3d(x, y, z);
}

// `pose` moved by a random increment from the left.
inline Rigid3 Perturbed(const Rigid3& pose, double sigma_rad, double sigma_translation, Random* random) {
  const Eigen::Vector3d rotation = GaussianVector(random, sigma_rad);
  return Rigid3(ExpSo3(rotation), GaussianVector(random, sigma_translation)) * pose;
}

struct SyntheticBundleOptions {
  int fixed_poses = 2;
  int free_poses = 8;
  int points = 200;
  int views_per_point = 5;    // in consecutive poses; 3 at least, where the point is out of view
  double noise_px = 0;        // of the keypoints
  double pose_error = 0.01;   // rad and map units, of the free poses at the start
  double point_error = 0.05;  // map units
};

// A camera that moves sideways along a wall of points at depth 3 to 7; fixed poses come first.
// `truth` gets the problem with exact poses and points.
inline BundleProblem SyntheticBundle(const SyntheticBundleOptions& options, Random* random,
                                     BundleProblem* truth) {
  const Camera camera = SyntheticCamera();
  const int poses = options.fixed_poses + options.free_poses;
  const double step = 0.1;
  BundleProblem problem;
  for (int i = 0; i < poses; ++i) {
    const Eigen::Vector3d sway = GaussianVector(random, 0.02), rotation = GaussianVector(random, 0.05);
    const Rigid3 world_from_cam(ExpSo3(rotation), Eigen::Vector3d(step * i, 0, 0) + sway);
    problem.poses.push_back({world_from_cam.Inverse(), i < options.fixed_poses});
  }
  while (problem.points.size() < static_cast<size_t>(options.points)) {
    const Eigen::Vector3d position(random->Uniform(-2, step * poses + 2), random->Uniform(-2, 2),
                                   random->Uniform(3, 7));
    const auto point = static_cast<uint32_t>(problem.points.size());
    const size_t observations_before = problem.observations.size();
    const int first = static_cast<int>(random->Index(static_cast<uint32_t>(poses)));
    int views = 0;
    for (int k = 0; k < poses && views < options.views_per_point; ++k) {
      const int i = (first + k) % poses;
      Eigen::Vector2d px = camera.Project(problem.poses[i].cam_from_world * position);
      if (px.x() < 0 || px.y() < 0 || px.x() > camera.width || px.y() > camera.height) continue;
      px.x() += options.noise_px * random->Gaussian();
      px.y() += options.noise_px * random->Gaussian();
      problem.observations.push_back({static_cast<uint32_t>(i), point, px});
      ++views;
    }
    if (views < 3) {
      problem.observations.resize(observations_before);
    } else {
      problem.points.push_back({position, false});
    }
  }
  if (truth != nullptr) *truth = problem;
  for (BundleProblem::Pose& pose : problem.poses) {
    if (!pose.fixed) {
      pose.cam_from_world = Perturbed(pose.cam_from_world, options.pose_error, options.pose_error, random);
    }
  }
  for (BundleProblem::Point& point : problem.points) {
    point.position += GaussianVector(random, options.point_error);
  }
  return problem;
}

// `count` points seen by one camera with unit noise of `noise_px`; the first `outliers` of them have random
// pixels instead.
inline PoseObservations SyntheticPoseObservations(const Rigid3& cam_from_world, int count, int outliers,
                                                  double noise_px, Random* random) {
  const Camera camera = SyntheticCamera();
  PoseObservations observations;
  for (int i = 0; i < count; ++i) {
    const double u = random->Uniform(0, camera.width), v = random->Uniform(0, camera.height);
    const Eigen::Vector3d x_in_cam = random->Uniform(1, 8) * camera.Unproject({u, v});
    Eigen::Vector2d px = camera.Project(x_in_cam);
    px.x() += noise_px * random->Gaussian();
    px.y() += noise_px * random->Gaussian();
    if (i < outliers) px = {random->Uniform(0, camera.width), random->Uniform(0, camera.height)};
    observations.Add(cam_from_world.Inverse() * x_in_cam, px, 1.0);
  }
  return observations;
}

}  // namespace dynamic_slam
