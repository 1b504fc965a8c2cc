// What nobody can know must not matter: where the world begins, which way it lies and how long its unit is;
// when the clock began; and, but for chance, which side is left.

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "dynamic_slam/geometry/sim3.h"
#include "dynamic_slam/geometry/sim3_estimation.h"
#include "dynamic_slam/geometry/triangulation.h"
#include "dynamic_slam/geometry/two_view_scene.h"
#include "dynamic_slam/optimize/bundle_adjustment.h"
#include "dynamic_slam/optimize/pose_optimizer.h"
#include "dynamic_slam/optimize/synthetic_bundle.h"
#include "small_room.h"
#include "whole_run.h"

namespace dynamic_slam {
namespace {

Sim3 RandomSim3(Random* random) {
  const double scale = std::pow(10, random->Uniform(-2, 2));
  return {scale, ExpSo3(GaussianVector(random, 1)), scale * GaussianVector(random, 5)};
}

// The same camera in the other world, whose unit of length is another one.
Rigid3 InOtherWorld(const Rigid3& cam_from_world, const Sim3& other_from_world) {
  const Sim3 stretch{other_from_world.scale, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()};
  const Sim3 cam_from_other = stretch * ToSim3(cam_from_world) * other_from_world.Inverse();
  return {cam_from_other.rotation, cam_from_other.translation};
}

double Difference(const Rigid3& a, const Rigid3& b, double unit) {
  return RotationAngle(a.rotation, b.rotation) + (a.translation - b.translation).norm() / unit;
}

TEST(Invariance, OfAPoseToTheWorld) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    const Rigid3 truth(ExpSo3({0.3, -0.5, 0.2}), {1.0, -2.0, 3.0});
    const PoseObservations observations = SyntheticPoseObservations(truth, 100, 20, 0.5, &random);
    const Rigid3 start = Perturbed(truth, 0.02, 0.05, &random);
    const Sim3 other_from_world = RandomSim3(&random);
    PoseObservations others = observations;
    for (size_t i = 0; i < others.size(); ++i) {
      const Eigen::Vector3d x = other_from_world * Eigen::Vector3d(others.x[i], others.y[i], others.z[i]);
      others.x[i] = x.x(), others.y[i] = x.y(), others.z[i] = x.z();
    }
    PoseOptimizer optimizer(SyntheticCamera());
    PoseEstimate here, there;
    optimizer.Optimize(observations, start, &here);
    optimizer.Optimize(others, InOtherWorld(start, other_from_world), &there);
    ASSERT_TRUE(here.converged && there.converged);
    EXPECT_EQ(here.is_inlier, there.is_inlier);
    EXPECT_LT(Difference(InOtherWorld(here.cam_from_world, other_from_world), there.cam_from_world,
                         other_from_world.scale),
              1e-4)
        << "seed " << seed;
  }
}

TEST(Invariance, OfATriangulatedPointToTheWorld) {
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    Random random(seed);
    const Sim3 other_from_world = RandomSim3(&random);
    const Rigid3 first = Perturbed({}, 0.1, 0.3, &random), second = Perturbed({}, 0.1, 0.3, &random);
    const Eigen::Vector3d point(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(3, 8));
    const auto ray = [&](const Rigid3& cam_from_world) {
      const Eigen::Vector3d x = cam_from_world * point;
      return Eigen::Vector3d(x.x() / x.z() + 0.001 * random.Gaussian(), x.y() / x.z(), 1);
    };
    const Eigen::Vector3d first_ray = ray(first), second_ray = ray(second);
    const auto here = TriangulateInWorld(first, first_ray, second, second_ray);
    const auto there = TriangulateInWorld(InOtherWorld(first, other_from_world), first_ray,
                                          InOtherWorld(second, other_from_world), second_ray);
    ASSERT_EQ(here.has_value(), there.has_value());
    if (!here.has_value()) continue;
    EXPECT_LT((other_from_world * *here - *there).norm(), 1e-6 * other_from_world.scale * here->norm())
        << "seed " << seed;
  }
}

TEST(Invariance, OfASimilarityToTheUnitsOfBothSides) {
  const Camera camera = TestCamera();
  const Sim3 first_from_second{0.7, ExpSo3({0.1, -0.3, 0.05}), {0.4, -0.1, 0.3}};
  Random random(1);
  std::vector<Sim3Match> matches, scaled;
  while (matches.size() < 80) {
    Sim3Match match;
    match.first_px = RandomPixel(camera, random);
    match.x_in_first = random.Uniform(2, 6) * camera.Unproject(match.first_px);
    match.x_in_second = first_from_second.Inverse() * match.x_in_first;
    if (!IsSeen(camera, match.x_in_second)) continue;
    match.second_px = matches.size() < 30
                          ? RandomPixel(camera, random)
                          : Eigen::Vector2d(camera.Project(match.x_in_second) + Noise(0.5, random));
    matches.push_back(match);
    match.x_in_first *= 16;
    match.x_in_second *= 0.25;
    scaled.push_back(match);
  }
  Random draws(1), same_draws(1);
  const Sim3Estimate here = EstimateSim3(camera, matches, {}, draws),
                     there = EstimateSim3(camera, scaled, {}, same_draws);
  ASSERT_TRUE(here.success && there.success);
  EXPECT_EQ(here.is_inlier, there.is_inlier);
  EXPECT_NEAR(there.first_from_second.scale, 64 * here.first_from_second.scale, 1e-3);
  EXPECT_LT((there.first_from_second.translation - 16 * here.first_from_second.translation).norm(), 1e-3);
}

TEST(Invariance, OfABundleToTheWorld) {
  BundleOptions options;
  options.max_iterations = options.refine_iterations = 100;
  options.function_tolerance = 1e-14;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    SyntheticBundleOptions scene;
    scene.noise_px = 0.5;
    BundleProblem here = SyntheticBundle(scene, &random, nullptr), there = here;
    const Sim3 other_from_world = RandomSim3(&random);
    for (BundleProblem::Pose& pose : there.poses)
      pose.cam_from_world = InOtherWorld(pose.cam_from_world, other_from_world);
    for (BundleProblem::Point& point : there.points) point.position = other_from_world * point.position;
    std::vector<uint8_t> outliers_here, outliers_there;
    ASSERT_TRUE(AdjustBundle(SyntheticCamera(), options, {}, &here, &outliers_here).usable);
    ASSERT_TRUE(AdjustBundle(SyntheticCamera(), options, {}, &there, &outliers_there).usable);
    EXPECT_EQ(outliers_here, outliers_there);
    for (size_t i = 0; i < here.poses.size(); ++i) {
      EXPECT_LT(Difference(InOtherWorld(here.poses[i].cam_from_world, other_from_world),
                           there.poses[i].cam_from_world, other_from_world.scale),
                1e-4)
          << "pose " << i << " of seed " << seed;
    }
  }
}

Trajectory RunRoom(const std::vector<cv::Mat>& images, const Camera& camera, double first_stamp_s) {
  SlamSystem system(camera, SmallRoom::CheapOptions());
  // Eighths of a second: differences are exact, whatever is added.
  for (size_t i = 0; i < images.size(); ++i)
    system.Process(first_stamp_s + 0.125 * static_cast<double>(i), images[i]);
  system.Finish();
  return system.FrameTrajectory();
}

TEST(Invariance, OfARunToTheClock) {
  const SmallRoom& room = SmallRoom::Get();
  const Trajectory early = RunRoom(room.images, SmallRoom::SmallCamera(), 0),
                   late = RunRoom(room.images, SmallRoom::SmallCamera(), 1700000000);
  ASSERT_GT(early.size(), 15u);
  ASSERT_EQ(early.size(), late.size());
  for (size_t i = 0; i < early.size(); ++i) {
    EXPECT_EQ(early[i].timestamp_s + 1700000000, late[i].timestamp_s);
    EXPECT_EQ(early[i].world_from_cam.translation, late[i].world_from_cam.translation);
    EXPECT_EQ(early[i].world_from_cam.rotation.coeffs(), late[i].world_from_cam.rotation.coeffs());
  }
}

TEST(Invariance, OfARunToMirrors) {
  const SmallRoom& room = SmallRoom::Get();
  std::vector<cv::Mat> mirrored;
  for (const cv::Mat& image : room.images) cv::flip(image, mirrored.emplace_back(), 1);
  Camera camera = SmallRoom::SmallCamera();
  camera.cx = camera.width - 1 - camera.cx;
  Trajectory truth = room.room.truth(), mirrored_truth = truth;
  const Eigen::Matrix3d mirror = Eigen::Vector3d(-1, 1, 1).asDiagonal();
  for (size_t i = 0; i < truth.size(); ++i) {
    truth[i].timestamp_s = mirrored_truth[i].timestamp_s = 0.125 * static_cast<double>(i);
    const Rigid3& pose = truth[i].world_from_cam;
    mirrored_truth[i].world_from_cam = {Eigen::Quaterniond(Eigen::Matrix3d(mirror * pose.rotation * mirror)),
                                        mirror * pose.translation};
  }
  const Trajectory path = RunRoom(room.images, SmallRoom::SmallCamera(), 0),
                   mirrored_path = RunRoom(mirrored, camera, 0);
  const double limit = 0.01 * PathLength(ToPoseList(truth));
  EXPECT_LE(ApeRmse(truth, path), limit);
  EXPECT_LE(ApeRmse(mirrored_truth, mirrored_path), limit);
  EXPECT_NEAR(static_cast<double>(path.size()), static_cast<double>(mirrored_path.size()), 4);
}

}  // namespace
}  // namespace dynamic_slam
