#include "dynamic_slam/geometry/rolling_shutter.h"

#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/two_view_scene.h"

namespace dynamic_slam {
namespace {

// The camera with the pose of the middle row since_s later, exact.
Rigid3 Later(const SteadyMotion& motion, double since_s) {
  // In steps that are small enough for the motion to be steady seen from the camera.
  constexpr int kSteps = 1000;
  Rigid3 later;
  const Rigid3 step(ExpSo3(since_s / kSteps * motion.angular_rad_s), since_s / kSteps * motion.linear_per_s);
  for (int i = 0; i < kSteps; ++i) later = step * later;
  return later;
}

struct Reading {
  Eigen::Vector2d px;  // where it was read
  double depth;        // at that time
};

// The row in which a point shows is the one that is read when it is there.
Reading Read(const Camera& camera, const SteadyMotion& motion, const Eigen::Vector3d& x_in_cam) {
  Reading reading{camera.Project(x_in_cam), x_in_cam.z()};
  for (int i = 0; i < 10; ++i) {
    const double since_s = (reading.px.y() / (camera.height - 1) - 0.5) * camera.readout_s;
    const Eigen::Vector3d x = Later(motion, since_s) * x_in_cam;
    reading = {camera.Project(x), x.z()};
  }
  return reading;
}

TEST(RollingShutter, WhatWasReadGoesBackToTheMiddleRow) {
  Camera camera = TestCamera();
  camera.readout_s = 0.023;
  Random random(1);
  // One draw after the other, as compilers choose in which order they evaluate arguments.
  const auto any = [&](double most) {
    Eigen::Vector3d vector;
    for (double& x : vector) x = random.Uniform(-most, most);
    return vector;
  };
  double read_error = 0;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d angular = any(2), linear = any(1);
    const SteadyMotion motion{angular, linear};
    const double depth = random.Uniform(0.5, 5), x = random.Uniform(50, 590), y = random.Uniform(50, 430);
    const Eigen::Vector2d truth(x, y);
    const Reading reading = Read(camera, motion, depth * camera.Unproject(truth));
    read_error = std::max(read_error, (reading.px - truth).norm());
    const Eigen::Vector2d px = AtMiddleRow(camera, motion, reading.px, reading.px.y(), 1 / reading.depth);
    EXPECT_LT((px - truth).norm(), 0.1) << i;
  }
  EXPECT_GT(read_error, 5);
}

TEST(RollingShutter, AllRowsAtOnceLeaveThePlaces) {
  const Camera camera = TestCamera();
  const SteadyMotion motion{{1, 2, 3}, {4, 5, 6}};
  for (const double y : {0.0, 100.0, 479.0}) {
    EXPECT_NEAR((AtMiddleRow(camera, motion, {100, y}, y, 1) - Eigen::Vector2d(100, y)).norm(), 0, 1e-9);
  }
}

TEST(RollingShutter, TheMiddleRowStays) {
  Camera camera = TestCamera();
  camera.readout_s = 0.03;
  const double middle = 0.5 * (camera.height - 1);
  const Eigen::Vector2d px(100, 200);  // of a lens that bends: the raw row is another one
  EXPECT_NEAR((AtMiddleRow(camera, {{1, 2, 3}, {4, 5, 6}}, px, middle, 1) - px).norm(), 0, 1e-9);
  EXPECT_GT((AtMiddleRow(camera, {{1, 2, 3}, {4, 5, 6}}, px, middle + 50, 1) - px).norm(), 0.5);
}

TEST(RollingShutter, AMotionIsThatBetweenTwoPoses) {
  const SteadyMotion motion{{0.3, -0.5, 0.2}, {0.1, 0.4, -0.2}};
  const SteadyMotion found = MotionBetween(Later(motion, 0.033), 0.033);
  EXPECT_LT((found.angular_rad_s - motion.angular_rad_s).norm(), 1e-6);
  EXPECT_LT((found.linear_per_s - motion.linear_per_s).norm(), 0.01);
  const SteadyMotion mean = Mean(motion, {{0.1, 0.1, 0}, {0.3, 0, 0}});
  EXPECT_LT((mean.angular_rad_s - Eigen::Vector3d(0.2, -0.2, 0.1)).norm(), 1e-12);
  EXPECT_LT((mean.linear_per_s - Eigen::Vector3d(0.2, 0.2, -0.1)).norm(), 1e-12);
}

TEST(RollingShutter, APathTellsHowItsCameraMoved) {
  const SteadyMotion motion{{0.3, -0.2, 0.5}, {0.4, 0.1, -0.2}};
  Trajectory path;
  for (const double stamp_s : {0.0, 0.1, 0.2, 0.3, 0.7})
    path.push_back({stamp_s, Later(motion, stamp_s).Inverse()});
  const std::map<double, SteadyMotion> motions = MotionsAlong(path);
  EXPECT_EQ(motions.size(), 4u) << "of the last pose no neighbour is near";
  EXPECT_FALSE(motions.contains(0.7));
  EXPECT_FALSE(motions.contains(0.15)) << "no pose";
  for (const auto& [stamp_s, found] : motions) {
    EXPECT_LT((found.angular_rad_s - motion.angular_rad_s).norm(), 1e-3) << stamp_s;
    // As the camera turns between the poses: half of the angle, 0.2 s long, times the velocity.
    EXPECT_LT((found.linear_per_s - motion.linear_per_s).norm(), 0.03) << stamp_s;
  }
  EXPECT_TRUE(MotionsAlong({}).empty());
  EXPECT_TRUE(MotionsAlong({path[0]}).empty());
}

}  // namespace
}  // namespace dynamic_slam
