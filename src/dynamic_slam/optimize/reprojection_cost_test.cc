#include "dynamic_slam/optimize/reprojection_cost.h"

#include <numbers>

#include <ceres/manifold_test_utils.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/optimize/bundle_solvers.h"

namespace dynamic_slam {
namespace {

using Pose = Eigen::Matrix<double, kPoseBlockSize, 1>;

Camera TestCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 520;
  camera.fy = 515;
  camera.cx = 321;
  camera.cy = 243;
  return camera;
}

Eigen::Vector3d RandomVector(Random* random, double scale) {
  return scale * Eigen::Vector3d(random->Gaussian(), random->Gaussian(), random->Gaussian());
}

Pose RandomPose(Random* random) {
  Pose pose;
  pose << ExpSo3(RandomVector(random, 1.0)).coeffs(), RandomVector(random, 2.0);
  return pose;
}

Eigen::Vector3d PointInFront(const Pose& pose, Random* random) {
  const Rigid3 cam_from_world(Eigen::Quaterniond(pose.head<4>()), pose.tail<3>());
  const Eigen::Vector3d x_in_cam(random->Uniform(-2, 2), random->Uniform(-2, 2), random->Uniform(2, 8));
  return cam_from_world.Inverse() * x_in_cam;
}

Eigen::Vector2d Residual(const ReprojectionCost& cost, const Pose& pose, const Eigen::Vector3d& point) {
  const double* parameters[] = {pose.data(), point.data()};
  Eigen::Vector2d residual;
  EXPECT_TRUE(cost.Evaluate(parameters, residual.data(), nullptr));
  return residual;
}

TEST(ReprojectionCostJacobian, OfThePointEqualsCentralDifferences) {
  Random random(1);
  const Camera camera = TestCamera();
  for (int trial = 0; trial < 20; ++trial) {
    const Pose pose = RandomPose(&random);
    const Eigen::Vector3d point = PointInFront(pose, &random);
    const ReprojectionCost cost(camera, {100, 200}, 0.7);
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> analytic;
    const double* parameters[] = {pose.data(), point.data()};
    double* jacobians[] = {nullptr, analytic.data()};
    ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d h = 1e-5 * Eigen::Vector3d::Unit(i);
      const Eigen::Vector2d numeric =
          (Residual(cost, pose, point + h) - Residual(cost, pose, point - h)) / 2e-5;
      EXPECT_NEAR((numeric - analytic.col(i)).norm(), 0, 1e-5) << "trial " << trial << " column " << i;
    }
  }
}

TEST(ReprojectionCostJacobian, OfThePoseBlockEqualsCentralDifferences) {
  Random random(2);
  const Camera camera = TestCamera();
  for (int trial = 0; trial < 20; ++trial) {
    const Pose pose = RandomPose(&random);
    const Eigen::Vector3d point = PointInFront(pose, &random);
    const ReprojectionCost cost(camera, {100, 200}, 0.7);
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 7, Eigen::RowMajor> analytic;
    const double* parameters[] = {pose.data(), point.data()};
    double* jacobians[] = {analytic.data(), nullptr};
    ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
    for (int i = 0; i < 7; ++i) {
      const Pose h = 1e-6 * Pose::Unit(i);
      const Eigen::Vector2d numeric =
          (Residual(cost, pose + h, point) - Residual(cost, pose - h, point)) / 2e-6;
      EXPECT_NEAR((numeric - analytic.col(i)).norm(), 0, 1e-4 * (1 + numeric.norm()))
          << "trial " << trial << " column " << i;
    }
  }
}

TEST(ReprojectionCostJacobian, AlongTheManifoldEqualsCentralDifferences) {
  Random random(3);
  const Camera camera = TestCamera();
  const PoseManifold manifold;
  for (int trial = 0; trial < 20; ++trial) {
    const Pose pose = RandomPose(&random);
    const Eigen::Vector3d point = PointInFront(pose, &random);
    const ReprojectionCost cost(camera, {100, 200}, 0.7);
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 7, Eigen::RowMajor> ambient;
    Eigen::Matrix<double, 7, 6, Eigen::RowMajor> plus;
    const double* parameters[] = {pose.data(), point.data()};
    double* jacobians[] = {ambient.data(), nullptr};
    ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
    ASSERT_TRUE(manifold.PlusJacobian(pose.data(), plus.data()));
    const Eigen::Matrix<double, 2, 6> analytic = ambient * plus;
    for (int i = 0; i < 6; ++i) {
      const Eigen::Matrix<double, 6, 1> h = 1e-6 * Eigen::Matrix<double, 6, 1>::Unit(i);
      const Eigen::Matrix<double, 6, 1> minus_h = -h;
      Pose above, below;
      manifold.Plus(pose.data(), h.data(), above.data());
      manifold.Plus(pose.data(), minus_h.data(), below.data());
      const Eigen::Vector2d numeric = (Residual(cost, above, point) - Residual(cost, below, point)) / 2e-6;
      EXPECT_NEAR((numeric - analytic.col(i)).norm(), 0, 1e-4) << "trial " << trial << " column " << i;
    }
  }
}

// Ceres checks Plus, Minus and both their Jacobians against each other and against differences.
TEST(PoseManifoldJacobian, HoldsTheInvariantsOfAManifold) {
  using namespace ceres;  // the macro below names its helpers without it
  Random random(4);
  const PoseManifold manifold;
  for (int trial = 0; trial < 20; ++trial) {
    const Pose x = RandomPose(&random);
    Eigen::Matrix<double, 6, 1> increment;
    increment << RandomVector(&random, 0.3), RandomVector(&random, 0.3);
    const Eigen::Matrix<double, 6, 1> other_increment = -0.7 * increment.reverse();
    Pose y;  // near x, since a quaternion and its negative are one rotation
    manifold.Plus(x.data(), other_increment.data(), y.data());
    EXPECT_THAT_MANIFOLD_INVARIANTS_HOLD(manifold, x, increment, y, 1e-9);
  }
}

TEST(PoseManifold, IncrementActsFromTheLeft) {
  Random random(5);
  const Pose pose = RandomPose(&random);
  const Rigid3 cam_from_world(Eigen::Quaterniond(pose.head<4>()), pose.tail<3>());
  Eigen::Matrix<double, 6, 1> increment;
  increment << 0.1, -0.2, 0.3, 1.0, 2.0, 3.0;
  Pose moved;
  PoseManifold().Plus(pose.data(), increment.data(), moved.data());
  const Rigid3 expected = Rigid3(ExpSo3(increment.head<3>()), increment.tail<3>()) * cam_from_world;
  EXPECT_LT((moved.head<4>() - expected.rotation.coeffs()).norm(), 1e-14);
  EXPECT_LT((moved.tail<3>() - expected.translation).norm(), 1e-14);
}

TEST(ReprojectionCost, IsThePixelDifferenceInSigmas) {
  const Camera camera = TestCamera();
  Pose pose = Pose::Unit(3);
  const ReprojectionCost cost(camera, {300, 250}, 0.5);
  const Eigen::Vector3d point(0.2, -0.1, 2.0);
  const Eigen::Vector2d expected = 0.5 * (camera.Project(point) - Eigen::Vector2d(300, 250));
  EXPECT_LT((Residual(cost, pose, point) - expected).norm(), 1e-12);
}

TEST(ReprojectionCost, StaysFiniteBehindTheCamera) {
  const Camera camera = TestCamera();
  const Pose pose = Pose::Unit(3);
  const ReprojectionCost cost(camera, {300, 250}, 1.0);
  for (const double z : {-2.0, -1e-12, 0.0, 1e-300}) {
    const Eigen::Vector3d point(0.2, -0.1, z);
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 7, Eigen::RowMajor> of_pose;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> of_point;
    const double* parameters[] = {pose.data(), point.data()};
    double* jacobians[] = {of_pose.data(), of_point.data()};
    ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
    EXPECT_TRUE(residual.allFinite() && of_pose.allFinite() && of_point.allFinite()) << "z = " << z;
    EXPECT_GT(residual.norm(), 1e3) << "z = " << z;
  }
}

// Centres at 1, 2 and 4, after 1 and 2 s: 1 m/s all the time; the last one at 5: half a metre per second
// more.
TEST(MotionCostTest, IsTheChangeOfVelocityInSigmas) {
  BundleProblem::Motion motion{{0, 1, 2}, 1, 2, 10};
  const MotionCost cost(MotionFactors(motion));
  Random random(5);
  for (const double last : {4.0, 5.0}) {
    std::vector<Pose> poses;
    for (const double x : {1.0, 2.0, last}) {
      const Rigid3 world_from_cam(ExpSo3(RandomVector(&random, 1.0)), {x, 0, 0});
      const Rigid3 cam_from_world = world_from_cam.Inverse();
      poses.emplace_back();
      poses.back() << cam_from_world.rotation.coeffs(), cam_from_world.translation;
    }
    const double* parameters[] = {poses[0].data(), poses[1].data(), poses[2].data()};
    Eigen::Vector3d residual;
    ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), nullptr));
    EXPECT_LT((residual - Eigen::Vector3d(10 * (last - 4) / 2, 0, 0)).norm(), 1e-9);
  }
}

// A quarter of a circle in each step: the velocity turns along.
TEST(MotionCostTest, ASteadyCurveHasNoChangeOfVelocity) {
  BundleProblem::Motion motion{{0, 1, 2}, 1, 1, 10};
  motion.turn = ExpSo3({0, 0, 0.5 * std::numbers::pi}).toRotationMatrix();
  const MotionCost cost(MotionFactors(motion));
  std::vector<Pose> poses;
  for (const Eigen::Vector3d& centre : {Eigen::Vector3d(1, 0, 0), {0, 1, 0}, {-1, 0, 0}}) {
    poses.emplace_back();
    poses.back() << Eigen::Quaterniond::Identity().coeffs(), -centre;
  }
  const double* parameters[] = {poses[0].data(), poses[1].data(), poses[2].data()};
  Eigen::Vector3d residual;
  ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), nullptr));
  EXPECT_LT(residual.norm(), 1e-9);
}

TEST(MotionCostTest, JacobiansEqualCentralDifferencesAlongTheManifold) {
  Random random(6);
  const PoseManifold manifold;
  const MotionCost cost(MotionFactors({{0, 1, 2}, 0.3, 0.1, 2, ExpSo3({0.1, 0.3, -0.2}).toRotationMatrix()}));
  std::vector<Pose> poses;
  for (int k = 0; k < 3; ++k) poses.push_back(RandomPose(&random));
  const auto residual_of = [&](const std::vector<Pose>& at) {
    const double* parameters[] = {at[0].data(), at[1].data(), at[2].data()};
    Eigen::Vector3d residual;
    EXPECT_TRUE(cost.Evaluate(parameters, residual.data(), nullptr));
    return residual;
  };
  for (size_t k = 0; k < 3; ++k) {
    Eigen::Matrix<double, 3, 7, Eigen::RowMajor> analytic;
    double* jacobians[] = {nullptr, nullptr, nullptr};
    jacobians[k] = analytic.data();
    const double* parameters[] = {poses[0].data(), poses[1].data(), poses[2].data()};
    Eigen::Vector3d residual;
    ASSERT_TRUE(cost.Evaluate(parameters, residual.data(), jacobians));
    Eigen::Matrix<double, 7, 6, Eigen::RowMajor> plus;
    ASSERT_TRUE(manifold.PlusJacobian(poses[k].data(), plus.data()));
    const Eigen::Matrix<double, 3, 6> along = analytic * plus;
    for (int i = 0; i < 6; ++i) {
      constexpr double kStep = 1e-6;
      Eigen::Matrix<double, 6, 1> increment = Eigen::Matrix<double, 6, 1>::Zero();
      std::vector<Pose> before = poses, after = poses;
      increment[i] = kStep;
      ASSERT_TRUE(manifold.Plus(poses[k].data(), increment.data(), after[k].data()));
      increment[i] = -kStep;
      ASSERT_TRUE(manifold.Plus(poses[k].data(), increment.data(), before[k].data()));
      const Eigen::Vector3d numeric = (residual_of(after) - residual_of(before)) / (2 * kStep);
      EXPECT_LT((along.col(i) - numeric).norm(), 1e-6 * (1 + numeric.norm())) << k << " " << i;
    }
  }
}

}  // namespace
}  // namespace dynamic_slam
