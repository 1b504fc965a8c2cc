#include "dynamic_slam/eval/scale_source.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/base/test_folder.h"

namespace dynamic_slam {
namespace {

using ::testing::HasSubstr;

constexpr double kUnit = 0.4;  // m

// A curve of 60 s, in units of the map, with noise.
Trajectory Curve(double noise) {
  Random random(5);
  Trajectory trajectory;
  for (int i = 0; i < 600; ++i) {
    const double t = 0.1 * i;
    StampedPose pose{t, {}};
    pose.world_from_cam.translation = {t + noise * random.Gaussian(),
                                       3 * std::sin(0.2 * t) + noise * random.Gaussian(),
                                       noise * random.Gaussian()};
    trajectory.push_back(pose);
  }
  return trajectory;
}

Trajectory Metric(Trajectory trajectory) {
  for (StampedPose& pose : trajectory) pose.world_from_cam.translation *= kUnit;
  return trajectory;
}

class ScaleSourceTest : public FolderTest {};

TEST_F(ScaleSourceTest, IsReadFromText) {
  const auto distance = std::get<KnownDistance>(ParseScaleSource("distance:1305031452.8,1305031460,2.5"));
  EXPECT_EQ(distance.first_s, 1305031452.8);
  EXPECT_EQ(distance.second_s, 1305031460);
  EXPECT_EQ(distance.metres, 2.5);
  EXPECT_EQ(std::get<KnownHeight>(ParseScaleSource("camera-height:1.6")).metres, 1.6);
  EXPECT_EQ(std::get<KnownTrajectory>(ParseScaleSource("file:a:b.txt")).file, "a:b.txt");
  for (const char* text : {"", "1.6", "height:1.6", "camera-height:", "camera-height:0", "camera-height:-1",
                           "camera-height:nan", "camera-height:1.6m", "distance:1,2", "distance:1,2,3,4",
                           "distance:a,2,3", "distance:1,2,-3", "file:"}) {
    EXPECT_THAT(ErrorOf([&] { ParseScaleSource(text); }), HasSubstr("--scale-from")) << text;
  }
}

TEST_F(ScaleSourceTest, ADistanceIsMeasuredWithinItsError) {
  const Trajectory exact = Curve(0);
  const double metres =
      kUnit * (exact[500].world_from_cam.translation - exact[50].world_from_cam.translation).norm();
  EXPECT_NEAR(ScaleFromDistance(exact, {5, 50, metres}).metres_per_unit, kUnit, 1e-5);
  const MetricScale scale = ScaleFromDistance(Curve(0.05), {5, 50, metres});
  EXPECT_LT(std::abs(scale.metres_per_unit / kUnit - 1), 3 * scale.relative_error);
  EXPECT_LT(scale.relative_error, 0.005);
  EXPECT_GT(scale.relative_error, 0.0005);
}

TEST_F(ScaleSourceTest, ADistanceThatSaysNothingIsRefused) {
  EXPECT_THAT(ErrorOf([] {
                ScaleFromDistance(Curve(0.01), {5, 61, 1});
              }),
              HasSubstr("from 0.000 to 59.900 s"));
  EXPECT_THAT(ErrorOf([] { ScaleFromDistance(Curve(0.05), {5, 5.1, 1}); }), HasSubstr("hardly moved"));
  EXPECT_THAT(ErrorOf([] { ScaleFromDistance({}, {5, 6, 1}); }), HasSubstr("There is no trajectory"));
}

TEST_F(ScaleSourceTest, ATrajectoryInMetresIsFollowed) {
  const MetricScale exact = ScaleFromTrajectory(Curve(0), Metric(Curve(0)), "gt.txt");
  EXPECT_NEAR(exact.metres_per_unit, kUnit, 1e-9);
  EXPECT_LT(exact.relative_error, 1e-9);
  const MetricScale scale = ScaleFromTrajectory(Curve(0.1), Metric(Curve(0)), "gt.txt");
  EXPECT_LT(std::abs(scale.metres_per_unit / kUnit - 1), 4 * scale.relative_error);
  EXPECT_LT(scale.relative_error, 0.01);
  Trajectory few = Metric(Curve(0));
  few.resize(20);
  EXPECT_THAT(ErrorOf([&] { ScaleFromTrajectory(Curve(0), few, "gt.txt"); }),
              HasSubstr("gt.txt: has 20 poses"));
}

// Keyframes along z, 1.5 units above landmarks on the ground, as far as `ground` says, between two walls.
Map StreetMap(int ground, double slope) {
  constexpr double kHeight = 1.5;
  Random random(9);
  Map map({1.0f});
  std::vector<KeyframeId> keyframes;
  constexpr int kFrames = 12, kWalls = 200;
  for (int i = 0; i < kFrames; ++i) {
    FeatureSet features;
    features.keypoints.resize(static_cast<size_t>(ground + kWalls));
    features.descriptors.resize(features.keypoints.size());
    const Rigid3 world_from_cam(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, i));
    keyframes.push_back(
        map.AddKeyframe(FrameId(static_cast<uint32_t>(i)), i, world_from_cam.Inverse(), features, {}).id());
  }
  for (int i = 0; i < ground + kWalls; ++i) {
    const bool is_ground = i < ground;
    const double side = random.Uniform() < 0.5 ? -4 : 4;
    const double x = is_ground ? random.Uniform(-4, 4) : side;
    const double y = is_ground ? kHeight + slope * x + 0.01 * random.Gaussian() : random.Uniform(-5, 1.4);
    const Landmark& landmark = map.AddLandmark({x, y, random.Uniform(14, 24)}, keyframes.front());
    for (const KeyframeId keyframe : keyframes) map.Link(keyframe, static_cast<uint32_t>(i), landmark.id());
  }
  return map;
}

TEST_F(ScaleSourceTest, AHeightIsMeasuredToTheGround) {
  const MetricScale scale = ScaleFromHeight(StreetMap(150, 0), PartId(0), {0.6}, 1);
  EXPECT_NEAR(scale.metres_per_unit, kUnit, 0.01 * kUnit);
  EXPECT_LT(scale.relative_error, 0.02);
  EXPECT_NEAR(ScaleFromHeight(StreetMap(150, 0.1), PartId(0), {0.6}, 1).metres_per_unit,
              kUnit * std::hypot(1, 0.1), 0.01 * kUnit);
}

TEST_F(ScaleSourceTest, WhereTheGroundIsNotVisibleItSaysSo) {
  EXPECT_THAT(ErrorOf([] { ScaleFromHeight(StreetMap(0, 0), PartId(0), {0.6}, 1); }),
              HasSubstr("the ground is not visible"));
  EXPECT_THAT(ErrorOf([] { ScaleFromHeight(Map({1.0f}), PartId(0), {0.6}, 1); }),
              HasSubstr("the ground is not visible"));
}

}  // namespace
}  // namespace dynamic_slam
