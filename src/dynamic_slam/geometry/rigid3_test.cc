#include "dynamic_slam/geometry/rigid3.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/sim3.h"

namespace dynamic_slam {
namespace {

Eigen::Vector3d RandomVector(Random& random) {
  return {random.Gaussian(), random.Gaussian(), random.Gaussian()};
}

Rigid3 RandomRigid3(Random& random) { return {ExpSo3(RandomVector(random)), RandomVector(random)}; }

TEST(So3, LogInvertsExpAtEveryAngleBelowPi) {
  Random random(1);
  for (const double angle : {0.0, 1e-300, 1e-12, 1e-8, 9.9e-5, 1.01e-4, 0.1, 1.0, 3.0, 3.14159}) {
    for (int trial = 0; trial < 20; ++trial) {
      const Eigen::Vector3d v = angle * RandomVector(random).normalized();
      const Eigen::Vector3d back = LogSo3(ExpSo3(v));
      EXPECT_LT((back - v).norm(), 1e-14 + 1e-13 * angle) << "angle " << angle;
    }
  }
}

TEST(So3, ExpIsTheRotationAboutTheAxis) {
  Random random(2);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::Vector3d axis = RandomVector(random).normalized();
    const double angle = random.Uniform(-3, 3);
    const Eigen::Matrix3d expected = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    EXPECT_LT((ExpSo3(angle * axis).toRotationMatrix() - expected).norm(), 1e-14);
  }
}

TEST(So3, LogGivesTheShortWayForBothSignsOfTheQuaternion) {
  const Eigen::Quaterniond q = ExpSo3({0.1, -0.2, 0.3});
  const Eigen::Quaterniond negated(-q.w(), -q.x(), -q.y(), -q.z());
  EXPECT_LT((LogSo3(q) - LogSo3(negated)).norm(), 1e-15);
  EXPECT_LE(LogSo3(ExpSo3({4.0, 0, 0})).norm(), std::numbers::pi);
}

TEST(So3, AngleAtPi) {
  EXPECT_NEAR(LogSo3(ExpSo3({0, std::numbers::pi, 0})).norm(), std::numbers::pi, 1e-12);
  EXPECT_NEAR(RotationAngle(Eigen::Quaterniond::Identity(), ExpSo3({0, 0, -2.0})), 2.0, 1e-14);
}

TEST(Rigid3, ActsOnPointsAsItsMatrix) {
  Random random(3);
  const Rigid3 a = RandomRigid3(random);
  const Eigen::Vector3d x = RandomVector(random);
  EXPECT_LT((a * x - (a.Matrix() * x + a.translation)).norm(), 1e-14);
}

TEST(Rigid3, ProductIsCompositionAndInverseUndoes) {
  Random random(4);
  for (int trial = 0; trial < 20; ++trial) {
    const Rigid3 a = RandomRigid3(random), b = RandomRigid3(random);
    const Eigen::Vector3d x = RandomVector(random);
    EXPECT_LT(((a * b) * x - a * (b * x)).norm(), 1e-13);
    EXPECT_LT((a.Inverse() * (a * x) - x).norm(), 1e-13);
    EXPECT_LT((a * a.TargetOriginInSource()).norm(), 1e-13);
  }
}

TEST(Rigid3, StaysARotationAfterManyProducts) {
  Random random(5);
  Rigid3 product;
  for (int i = 0; i < 100000; ++i) product = product * Rigid3(ExpSo3({1e-3, 2e-3, -1e-3}), {1e-3, 0, 0});
  EXPECT_NEAR(product.rotation.norm(), 1.0, 1e-14);
  EXPECT_TRUE(product.IsFinite());
}

TEST(Rigid3, KnowsWhenItIsNotFinite) {
  Rigid3 a;
  a.translation.y() = std::nan("");
  EXPECT_FALSE(a.IsFinite());
}

TEST(Sim3, ProductIsCompositionAndInverseUndoes) {
  Random random(6);
  for (int trial = 0; trial < 20; ++trial) {
    const Sim3 a{random.Uniform(0.2, 4), ExpSo3(RandomVector(random)), RandomVector(random)};
    const Sim3 b{random.Uniform(0.2, 4), ExpSo3(RandomVector(random)), RandomVector(random)};
    const Eigen::Vector3d x = RandomVector(random);
    EXPECT_LT(((a * b) * x - a * (b * x)).norm(), 1e-12);
    EXPECT_LT((a.Inverse() * (a * x) - x).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace dynamic_slam
