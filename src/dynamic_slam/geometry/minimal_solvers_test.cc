#include <algorithm>
#include <cmath>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "dynamic_slam/geometry/essential.h"
#include "dynamic_slam/geometry/homography.h"
#include "dynamic_slam/geometry/p3p.h"
#include "dynamic_slam/geometry/polynomial.h"
#include "dynamic_slam/geometry/ransac.h"
#include "dynamic_slam/geometry/triangulation.h"
#include "dynamic_slam/geometry/two_view_scene.h"

namespace dynamic_slam {
namespace {

double Distance(const Rigid3& a, const Rigid3& b) {
  return RotationAngle(a.rotation, b.rotation) + (a.translation - b.translation).norm();
}

Rigid3 RandomUnitMotion(Random& random) {
  const Eigen::Vector3d turn(random.Uniform(-0.3, 0.3), random.Uniform(-0.3, 0.3), random.Uniform(-0.3, 0.3));
  const Eigen::Vector3d shift(random.Gaussian(), random.Gaussian(), random.Gaussian());
  return {ExpSo3(turn), shift.normalized()};
}

Eigen::Vector3d RandomPoint(Random& random) {
  const double z = random.Uniform(4, 8);
  return {z * random.Uniform(-0.5, 0.5), z * random.Uniform(-0.4, 0.4), z};
}

TEST(RealRoots, FindsRootsInsideAndOutsideTheUnitInterval) {
  // (x - 0.5) (x + 0.25) (x - 4) (x + 100) (x^2 + 1)
  std::array<double, 7> p = {1};
  int degree = 0;
  const auto multiply = [&](std::vector<double> factor) {
    std::array<double, 7> product = {};
    for (int i = 0; i <= degree; ++i) {
      for (size_t j = 0; j < factor.size(); ++j) product[i + j] += p[i] * factor[j];
    }
    degree += static_cast<int>(factor.size()) - 1;
    p = product;
  };
  for (const double root : {0.5, -0.25, 4.0, -100.0}) multiply({-root, 1});
  multiply({1, 0, 1});
  std::array<double, 12> roots;
  const int count = RealRoots<6>(p, &roots);
  ASSERT_EQ(count, 4);
  std::sort(roots.begin(), roots.begin() + count);
  const double expected[] = {-100, -0.25, 0.5, 4};
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(roots[i], expected[i], 1e-10 * std::abs(expected[i]));
}

void ExpectFivePointFindsTruth(bool planar) {
  Random random(3);
  int missed = 0;  // almost double roots are lost or inexact now and then
  for (int trial = 0; trial < 200; ++trial) {
    const Rigid3 motion = RandomUnitMotion(random);
    std::array<Eigen::Vector3d, 5> first, second;
    for (int i = 0; i < 5; ++i) {
      Eigen::Vector3d x = RandomPoint(random);
      if (planar) x *= 6.0 / x.dot(Eigen::Vector3d(0.2, -0.3, 1));
      first[i] = x / x.z();
      const Eigen::Vector3d y = motion * x;
      second[i] = y / y.z();
    }
    const Eigen::Matrix3d truth = EssentialFromPose(motion).normalized();
    double best = 2;
    const auto solutions = FivePointEssential(first, second);
    EXPECT_LE(solutions.size(), 10u);
    for (const auto& E : solutions) {
      best = std::min({best, (E - truth).norm(), (E + truth).norm()});
      for (int i = 0; i < 5; ++i) EXPECT_NEAR(second[i].dot(E * first[i]), 0, 1e-9);
    }
    missed += best > 1e-5;
  }
  EXPECT_LE(missed, 4);
}

TEST(FivePoint, FindsTheTruthAmongItsSolutions) { ExpectFivePointFindsTruth(false); }
TEST(FivePoint, FindsTheTruthForPointsOnAPlane) { ExpectFivePointFindsTruth(true); }

TEST(Essential, HasFourPosesOneOfThemTheTruth) {
  Random random(4);
  const Rigid3 motion = RandomUnitMotion(random);
  const auto poses = PosesFromEssential(EssentialFromPose(motion));
  int equal = 0;
  for (const Rigid3& pose : poses) equal += Distance(pose, motion) < 1e-9;
  EXPECT_EQ(equal, 1);
}

TEST(RefineRelativePose, ReachesTheTruthOfExactMatchesFromDegreesAway) {
  const Camera camera = TestCamera();
  Random random(5);
  const Rigid3 motion(ExpSo3({0.02, -0.05, 0.03}), Eigen::Vector3d(-0.9, 0.2, 0.3).normalized());
  const MatchSet set = MakeMatches(camera, motion, 100, 0.0, random,
                                   [](const Eigen::Vector2d&, Random& r) { return r.Uniform(4, 12); });
  std::vector<PixelPair> pairs;
  for (size_t i = 0; i < set.first_px.size(); ++i) {
    pairs.push_back({set.first_px[i].x() - camera.cx, set.first_px[i].y() - camera.cy,
                     set.second_px[i].x() - camera.cx, set.second_px[i].y() - camera.cy});
  }
  const Rigid3 start(motion.rotation * ExpSo3({0.002, 0.002, -0.002}),
                     (motion.translation + Eigen::Vector3d(0, 0.05, 0.05)).normalized());
  EXPECT_LT(Distance(RefineRelativePose(pairs, camera.fx, camera.fy, 10, 30, start), motion), 1e-7);
}

TEST(Homography, OfFourAndOfManyPointsIsTheTruth) {
  Random random(6);
  Eigen::Matrix3d H;
  H << 1.1, 0.05, 0.1, -0.04, 0.95, -0.2, 0.03, 0.08, 1.0;
  std::array<Eigen::Vector3d, 4> first4, second4;
  std::vector<Eigen::Vector2d> first, second;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d p(random.Uniform(-0.5, 0.5), random.Uniform(-0.4, 0.4));
    const Eigen::Vector3d q = H * p.homogeneous();
    first.push_back(p);
    second.push_back(q.hnormalized());
    if (i < 4) first4[i] = p.homogeneous(), second4[i] = q / q.z();
  }
  const auto of_four = HomographyFromFour(first4, second4), of_many = FitHomography(first, second);
  ASSERT_TRUE(of_four && of_many);
  EXPECT_LT((*of_four / (*of_four)(2, 2) - H).norm(), 1e-9);
  EXPECT_LT((*of_many / (*of_many)(2, 2) - H).norm(), 1e-9);
  first4[2] = 0.5 * (first4[0] + first4[1]);
  EXPECT_FALSE(HomographyFromFour(first4, second4)) << "three collinear points";
}

TEST(Homography, OneOfItsPosesIsTheTruth) {
  Random random(7);
  for (int trial = 0; trial < 50; ++trial) {
    const Rigid3 motion = RandomUnitMotion(random);
    const Eigen::Vector3d normal = Eigen::Vector3d(random.Gaussian(), random.Gaussian(), 2).normalized();
    const Eigen::Matrix3d H = motion.Matrix() + motion.translation * normal.transpose() / 3.0;
    double best = 10;
    const auto poses = PosesFromHomography(-2.5 * H);
    EXPECT_EQ(poses.size(), 4u);
    for (const Rigid3& pose : poses) best = std::min(best, Distance(pose, motion));
    EXPECT_LT(best, 1e-6) << "trial " << trial;
  }
}

TEST(Homography, OfARotationHasNoTranslation) {
  const Eigen::Quaterniond rotation = ExpSo3({0.1, -0.2, 0.05});
  const auto poses = PosesFromHomography(0.4 * rotation.toRotationMatrix());
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_EQ(poses[0].translation.norm(), 0);
  EXPECT_LT(RotationAngle(poses[0].rotation, rotation), 1e-9);
}

TEST(Homography, TheTwinOfAMotionSeesThePlaneAlike) {
  Random random(8);
  const Eigen::Vector3d plane = Eigen::Vector3d(0.1, -0.2, -1) / -2.0;
  const Rigid3 motion(ExpSo3({0.02, -0.1, 0.02}), Eigen::Vector3d(-0.4, 0.1, 0.05).normalized());
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d ray(random.Uniform(-0.5, 0.5), random.Uniform(-0.4, 0.4), 1);
    // A tenth is far from the plane.
    points.push_back(ray * (i % 10 == 0 ? random.Uniform(3, 9) : 1 / plane.dot(ray)));
  }
  const auto twin = TwinMotion(motion, points);
  ASSERT_TRUE(twin);
  EXPECT_NEAR(twin->translation.norm(), 1, 1e-9);
  EXPECT_GT(Degrees(RotationAngle(twin->rotation, motion.rotation)), 1);
  const Eigen::Matrix3d E = EssentialFromPose(*twin);
  for (size_t i = 0; i < points.size(); ++i) {
    const double error = std::abs((motion * points[i]).normalized().dot(E * points[i].normalized()));
    if (i % 10 == 0) {
      EXPECT_GT(error, 1e-4) << i;
    } else {
      EXPECT_LT(error, 1e-6) << i;
    }
  }
  const auto back = TwinMotion(*twin, std::vector<Eigen::Vector3d>());
  EXPECT_FALSE(back) << "no points";
}

TEST(Homography, APlaneApproachedHeadOnHasNoTwin) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 64; ++i) points.emplace_back(i % 8 - 4, i / 8 - 4, 5);
  EXPECT_FALSE(TwinMotion(Rigid3(ExpSo3({0, 0, 0}), {0, 0, -1}), points));
}

TEST(P3p, FindsTheTruthAmongItsSolutions) {
  Random random(8);
  int missed = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const Rigid3 cam_from_world(ExpSo3({random.Gaussian(), random.Gaussian(), random.Gaussian()}),
                                Eigen::Vector3d(random.Gaussian(), random.Gaussian(), random.Gaussian()));
    std::array<Eigen::Vector3d, 3> points, rays;
    for (int i = 0; i < 3; ++i) {
      rays[i] = RandomPoint(random);
      points[i] = cam_from_world.Inverse() * rays[i];
      rays[i] /= rays[i].z();
    }
    const auto poses = SolveP3p(points, rays);
    EXPECT_LE(poses.size(), 4u);
    double best = 10;
    for (const Rigid3& pose : poses) {
      best = std::min(best, Distance(pose, cam_from_world));
      for (int i = 0; i < 3; ++i) EXPECT_LT(ParallaxAngle(pose * points[i], rays[i]), 1e-5);
    }
    missed += best > 1e-5;
  }
  EXPECT_LE(missed, 2);
}

TEST(P3p, RefusesCollinearPoints) {
  const Eigen::Vector3d a(0, 0, 5), step(0.3, 0.2, 0.1);
  EXPECT_TRUE(SolveP3p({a, a + step, a + 2 * step}, {a, a + step, a + 2 * step}).empty());
}

TEST(Ransac, DrawsDifferentIndicesAndCountsIterations) {
  Random random(9);
  for (int i = 0; i < 100; ++i) {
    auto sample = DrawSample<5>(6, random);
    std::sort(sample.begin(), sample.end());
    EXPECT_EQ(std::unique(sample.begin(), sample.end()), sample.end());
    EXPECT_LT(sample.back(), 6u);
  }
  EXPECT_EQ(RansacIterations(0.5, 5, 0.999, 1000), 218);
  EXPECT_EQ(RansacIterations(1.0, 5, 0.999, 1000), 1);
  EXPECT_EQ(RansacIterations(0.0, 5, 0.999, 1000), 1000);
}

}  // namespace
}  // namespace dynamic_slam
