#include "dynamic_slam/geometry/triangulation.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "dynamic_slam/geometry/two_view_scene.h"

namespace dynamic_slam {
namespace {

const Rigid3 kSecondFromFirst(ExpSo3({0.05, -0.1, 0.02}), {-0.5, 0.1, 0.05});

Eigen::Vector3d Ray(const Eigen::Vector3d& x) { return x / x.z(); }

TEST(Triangulation, RecoversExactPoints) {
  Random random(1);
  const TwoViewTriangulator triangulator(kSecondFromFirst);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d x(random.Uniform(-2, 2), random.Uniform(-2, 2), random.Uniform(2, 30));
    const auto found = triangulator.Triangulate(Ray(x), Ray(kSecondFromFirst * x));
    ASSERT_TRUE(found);
    EXPECT_LT((*found - x).norm(), 1e-9 * x.norm());
  }
}

TEST(Triangulation, InWorldAgreesWithFirstCameraFrame) {
  const Rigid3 first_from_world(ExpSo3({0.3, 0.2, -1.0}), {3, -2, 1});
  const Rigid3 second_from_world = kSecondFromFirst * first_from_world;
  const Eigen::Vector3d x_in_first(0.4, -0.2, 5), x = first_from_world.Inverse() * x_in_first;
  const auto found =
      TriangulateInWorld(first_from_world, Ray(x_in_first), second_from_world, Ray(second_from_world * x));
  ASSERT_TRUE(found);
  EXPECT_LT((*found - x).norm(), 1e-10);
}

// With noise, nothing near the answer may have a smaller sum of squared reprojection errors.
TEST(Triangulation, MinimisesReprojectionErrorAlsoAtLowParallax) {
  Camera camera = TestCamera();
  camera.fy = camera.fx;  // the method's error is in normalised images
  Random random(2);
  for (const double baseline : {0.5, 0.1, 0.03}) {
    const Rigid3 second_from_first(ExpSo3({0.01, 0.02, 0.03}),
                                   Eigen::Vector3d(-baseline, 0.1 * baseline, 0.0));
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector3d x(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(3, 4));
      const Eigen::Vector2d first_px = camera.Project(x) + Noise(1.0, random);
      const Eigen::Vector2d second_px = camera.Project(second_from_first * x) + Noise(1.0, random);
      const auto cost = [&](const Eigen::Vector3d& p) {
        return SquaredReprojectionError(camera, Rigid3(), p, first_px) +
               SquaredReprojectionError(camera, second_from_first, p, second_px);
      };
      const auto found = TwoViewTriangulator(second_from_first)
                             .Triangulate(camera.Unproject(first_px), camera.Unproject(second_px));
      ASSERT_TRUE(found) << baseline;
      for (int axis = 0; axis < 3; ++axis) {
        for (const double step : {-1e-3, 1e-3}) {
          EXPECT_LT(cost(*found), cost(*found + step * found->z() * Eigen::Vector3d::Unit(axis)) + 1e-6);
        }
      }
    }
  }
}

TEST(Triangulation, RefusesPointsBehindEitherCamera) {
  const TwoViewTriangulator triangulator(kSecondFromFirst);
  const Eigen::Vector3d behind(0.3, 0.2, -4);
  EXPECT_FALSE(triangulator.Triangulate(Ray(behind), Ray(kSecondFromFirst * behind)));
  // Between two cameras that face each other's back: in front of one, behind the other.
  const Rigid3 ahead(Eigen::Quaterniond::Identity(), {0.5, 0, -4});
  const Eigen::Vector3d between(0.3, 0.2, 2);
  EXPECT_FALSE(TwoViewTriangulator(ahead).Triangulate(Ray(between), Ray(ahead * between)));
}

TEST(Triangulation, RefusesParallelRaysAndNoBaseline) {
  const Eigen::Vector3d direction(0.1, 0.2, 1);
  const Rigid3 shifted(Eigen::Quaterniond::Identity(), {-1, 0, 0});
  EXPECT_FALSE(TwoViewTriangulator(shifted).Triangulate(direction, direction));
  EXPECT_FALSE(TwoViewTriangulator(Rigid3()).Triangulate(direction, Eigen::Vector3d(0.1, 0.25, 1)));
}

TEST(Triangulation, ParallaxAngleIsExactForTinyAngles) {
  EXPECT_DOUBLE_EQ(ParallaxAngle({0, 0, 2}, {3e-9, 0, 3}), 1e-9);
  EXPECT_DOUBLE_EQ(ParallaxAngle({0, 0, 1}, {0, 5, 0}), std::numbers::pi / 2);
  EXPECT_DOUBLE_EQ(ParallaxAngle({0, 0, 1}, {0, 0, -7}), std::numbers::pi);
}

TEST(Triangulation, ReprojectionErrorIsInSquaredPixels) {
  const Camera camera = TestCamera();
  const Eigen::Vector3d x(0.1, 0.2, 2);
  EXPECT_NEAR(SquaredReprojectionError(camera, Rigid3(), x, camera.Project(x) + Eigen::Vector2d(3, 4)), 25,
              1e-9);
  EXPECT_EQ(SquaredReprojectionError(camera, Rigid3(), -x, camera.Project(x)),
            std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace dynamic_slam
