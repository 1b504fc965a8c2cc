#include "dynamic_slam/optimize/pose_optimizer.h"

#include <cmath>
#include <limits>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "dynamic_slam/optimize/synthetic_bundle.h"

namespace dynamic_slam {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Rigid3 TruePose() { return {ExpSo3({0.3, -0.5, 0.2}), {1.0, -2.0, 3.0}}; }

PoseEstimate Optimize(const PoseObservations& observations, const Rigid3& initial,
                      const PoseOptimizerOptions& options = {}) {
  PoseEstimate estimate;
  PoseOptimizer(SyntheticCamera(), options).Optimize(observations, initial, &estimate);
  return estimate;
}

double PoseError(const Rigid3& a, const Rigid3& b) {
  return RotationAngle(a.rotation, b.rotation) + (a.translation - b.translation).norm();
}

void ExpectGivenUp(const PoseEstimate& estimate, const Rigid3& initial, size_t size) {
  EXPECT_FALSE(estimate.converged);
  EXPECT_EQ(estimate.inliers, 0);
  EXPECT_EQ(estimate.is_inlier, std::vector<uint8_t>(size, 0));
  EXPECT_EQ(estimate.cam_from_world.translation, initial.translation);
  EXPECT_EQ(estimate.cam_from_world.rotation.coeffs(), initial.rotation.coeffs());
}

TEST(PoseOptimizer, FindsThePoseOfExactPixels) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    Random random(seed);
    const int count = 30 + static_cast<int>(seed);  // also numbers that do not fill a block
    const PoseObservations observations = SyntheticPoseObservations(TruePose(), count, 0, 0.0, &random);
    const PoseEstimate estimate = Optimize(observations, Perturbed(TruePose(), 0.03, 0.1, &random));
    ASSERT_TRUE(estimate.converged);
    EXPECT_EQ(estimate.inliers, count);
    EXPECT_LT(PoseError(estimate.cam_from_world, TruePose()), 1e-9) << "seed " << seed;
    EXPECT_LT(estimate.rms_px, 1e-6);
  }
}

TEST(PoseOptimizer, InformationPredictsTheScatterOfNoisyPoses) {
  double normalised = 0;
  double rms = 0;
  const int trials = 200;
  PoseOptimizerOptions options;
  options.chi2 = 100;  // every point stays, so that theory and practice weigh the same ones
  for (uint64_t seed = 0; seed < trials; ++seed) {
    Random random(seed);
    const PoseObservations observations = SyntheticPoseObservations(TruePose(), 100, 0, 1.0, &random);
    const PoseEstimate estimate = Optimize(observations, TruePose(), options);
    ASSERT_TRUE(estimate.converged);
    const Rigid3 error = TruePose() * estimate.cam_from_world.Inverse();
    Eigen::Matrix<double, 6, 1> increment;
    increment << LogSo3(error.rotation), error.translation;
    normalised += increment.dot(estimate.information * increment) / trials;
    rms += estimate.rms_px / trials;
  }
  EXPECT_NEAR(normalised, 6.0, 1.0);  // chi-squared with 6 degrees of freedom
  EXPECT_NEAR(rms, std::sqrt(2.0), 0.1);
}

// The information is J^T W J: by the errors of the pixels, central differences along each increment.
TEST(PoseOptimizer, InformationEqualsThatOfNumericDifferences) {
  Random random(3);
  const Camera camera = SyntheticCamera();
  const PoseObservations seen = SyntheticPoseObservations(TruePose(), 61, 0, 0.3, &random);  // fills no block
  const PoseEstimate estimate = Optimize(seen, TruePose());
  ASSERT_EQ(estimate.inliers, 61);
  Eigen::Matrix<double, 6, 6> numeric = Eigen::Matrix<double, 6, 6>::Zero();
  for (size_t i = 0; i < seen.size(); ++i) {
    if (estimate.is_inlier[i] == 0) continue;
    Eigen::Matrix<double, 2, 6> J;
    for (int k = 0; k < 6; ++k) {
      const auto project = [&](double step) {
        Eigen::Matrix<double, 6, 1> increment = Eigen::Matrix<double, 6, 1>::Zero();
        increment[k] = step;
        const Rigid3 moved = Rigid3(ExpSo3(increment.head<3>()), Eigen::Vector3d(increment.tail<3>())) *
                             estimate.cam_from_world;
        return camera.Project(moved * Eigen::Vector3d(seen.x[i], seen.y[i], seen.z[i]));
      };
      J.col(k) = (project(1e-6) - project(-1e-6)) / 2e-6;
    }
    numeric += J.transpose() * J;
  }
  EXPECT_LT((estimate.information - numeric).norm(), 1e-5 * numeric.norm());
}

// Points that were placed with wrong depths, along the rays of the camera at the origin that saw them; the
// camera has moved to the side since. What is taken for certain shortens the motion, as a rotation explains
// the rest.
TEST(PoseOptimizer, UncertainDepthsDoNotShortenTheMotion) {
  const Camera camera = SyntheticCamera();
  const Rigid3 truth(Eigen::Quaterniond::Identity(), {-0.3, 0, 0});
  constexpr double kDepthError = 0.15;  // over the depth
  PoseOptimizerOptions options;
  options.chi2 = 1e4;  // every point stays
  double certain = 0, uncertain = 0;
  const int trials = 100;
  for (uint64_t seed = 0; seed < trials; ++seed) {
    Random random(seed);
    PoseObservations with, without;
    for (int i = 0; i < 150; ++i) {
      const Eigen::Vector3d ray =
          camera.Unproject({random.Uniform(0, camera.width), random.Uniform(0, camera.height)});
      const double depth = random.Uniform(3, 6);
      Eigen::Vector2d px = camera.Project(truth * (depth * ray));
      px += 0.5 * Eigen::Vector2d(random.Gaussian(), random.Gaussian());
      const Eigen::Vector3d point = depth * (1 + kDepthError * random.Gaussian()) * ray;
      with.Add(point, px, 1.0, 1.0, depth * kDepthError * ray);
      without.Add(point, px, 1.0);
    }
    uncertain += Optimize(with, Rigid3(), options).cam_from_world.translation.norm() / trials;
    certain += Optimize(without, Rigid3(), options).cam_from_world.translation.norm() / trials;
  }
  EXPECT_LT(certain, 0.8 * 0.3);
  EXPECT_NEAR(uncertain, 0.3, 0.05 * 0.3);
}

TEST(PoseOptimizer, FindsThePoseAmongOutliers) {
  for (const int outliers : {80, 100}) {
    for (uint64_t seed = 0; seed < 50; ++seed) {
      SCOPED_TRACE(testing::Message() << outliers << " outliers of 200, seed " << seed);
      Random random(seed);
      const PoseObservations observations =
          SyntheticPoseObservations(TruePose(), 200, outliers, 0.5, &random);
      const PoseEstimate estimate = Optimize(observations, Perturbed(TruePose(), 0.03, 0.06, &random));
      ASSERT_TRUE(estimate.converged);
      EXPECT_LT(PoseError(estimate.cam_from_world, TruePose()), 0.005);
      int false_inliers = 0, true_inliers = 0;
      for (int i = 0; i < 200; ++i) (i < outliers ? false_inliers : true_inliers) += estimate.is_inlier[i];
      EXPECT_LE(false_inliers, 2);
      EXPECT_GE(true_inliers, 197 - outliers);
    }
  }
}

TEST(PoseOptimizer, FindsThePoseAmongSixtyPercentOfOutliersNearlyAlways) {
  int found = 0;
  for (uint64_t seed = 0; seed < 100; ++seed) {
    Random random(seed);
    const PoseObservations observations = SyntheticPoseObservations(TruePose(), 200, 120, 0.5, &random);
    const PoseEstimate estimate = Optimize(observations, Perturbed(TruePose(), 0.03, 0.06, &random));
    if (estimate.converged && PoseError(estimate.cam_from_world, TruePose()) < 0.01) ++found;
  }
  EXPECT_GE(found, 90);  // with the same limit in all rounds: 62
}

TEST(PoseOptimizer, HowFarOffAnOutlierIsDependsOnItsOctave) {
  Random random(1);
  PoseObservations observations = SyntheticPoseObservations(TruePose(), 50, 0, 0.0, &random);
  observations.u[0] += 6;
  observations.u[1] += 6;
  observations.inverse_sigma_px[0] = 0.25;
  const PoseEstimate estimate = Optimize(observations, TruePose());
  EXPECT_EQ(estimate.is_inlier[0], 1);
  EXPECT_EQ(estimate.is_inlier[1], 0);
  EXPECT_EQ(estimate.inliers, 49);
}

TEST(PoseOptimizer, OutliersComeBackWhenThePoseExplainsThem) {
  // From a start this far no point is within chi2, yet at the end all are.
  Random random(7);
  const PoseObservations observations = SyntheticPoseObservations(TruePose(), 50, 0, 0.2, &random);
  const PoseEstimate estimate = Optimize(observations, Rigid3(ExpSo3({0, 0.1, 0}), {0.3, 0, 0}) * TruePose());
  ASSERT_TRUE(estimate.converged);
  EXPECT_EQ(estimate.inliers, 50);
}

TEST(PoseOptimizer, WeightsDecideBetweenTwoExplanations) {
  Random random(3);
  const Rigid3 moved = Rigid3(ExpSo3({0, 0.002, 0}), {0.005, 0, 0}) * TruePose();
  const auto optimize = [&](double trust_in_moved) {
    Random same(11);
    PoseObservations observations = SyntheticPoseObservations(TruePose(), 60, 0, 0.0, &same);
    const PoseObservations others = SyntheticPoseObservations(moved, 60, 0, 0.0, &same);
    for (size_t i = 0; i < others.size(); ++i) {
      observations.Add({others.x[i], others.y[i], others.z[i]}, {others.u[i], others.v[i]}, 1.0,
                       trust_in_moved);
    }
    return Optimize(observations, TruePose());
  };
  const PoseEstimate without = optimize(0.0);
  EXPECT_LT(PoseError(without.cam_from_world, TruePose()), 1e-9);
  EXPECT_EQ(without.inliers, 60);
  const double little = PoseError(optimize(0.01).cam_from_world, TruePose());
  const double equal = PoseError(optimize(1.0).cam_from_world, TruePose());
  const double much = PoseError(optimize(100.0).cam_from_world, TruePose());
  EXPECT_LT(little, equal);
  EXPECT_LT(equal, much);
}

TEST(PoseOptimizer, PointsBehindTheCameraAreOutliers) {
  Random random(5);
  PoseObservations observations = SyntheticPoseObservations(TruePose(), 40, 0, 0.0, &random);
  const Rigid3 world_from_cam = TruePose().Inverse();
  observations.Add(world_from_cam * Eigen::Vector3d(0.1, 0.1, -3.0), {330, 250}, 1.0);
  observations.Add(world_from_cam * Eigen::Vector3d(0.1, 0.1, -0.2), {330, 250}, 1.0);
  const PoseEstimate estimate = Optimize(observations, Perturbed(TruePose(), 0.01, 0.01, &random));
  ASSERT_TRUE(estimate.converged);
  EXPECT_EQ(estimate.inliers, 40);
  EXPECT_EQ(estimate.is_inlier[40], 0);
  EXPECT_EQ(estimate.is_inlier[41], 0);
}

TEST(PoseOptimizer, NumbersThatAreNotFiniteAreOutliers) {
  Random random(5);
  PoseObservations observations = SyntheticPoseObservations(TruePose(), 40, 0, 0.0, &random);
  observations.Add({kNan, 0, 0}, {330, 250}, 1.0);
  observations.Add({0, 0, 3}, {330, std::numeric_limits<double>::infinity()}, 1.0);
  observations.Add({0, 0, 3}, {330, 250}, kNan);
  observations.Add({0, 0, 3}, {330, 250}, 1.0, kNan);
  const PoseEstimate estimate = Optimize(observations, TruePose());
  ASSERT_TRUE(estimate.converged);
  EXPECT_EQ(estimate.inliers, 40);
  EXPECT_TRUE(estimate.information.allFinite());
}

TEST(PoseOptimizer, TooLittleToGoOnGivesUp) {
  const Rigid3 initial = TruePose();
  Random random(5);
  ExpectGivenUp(Optimize({}, initial), initial, 0);
  ExpectGivenUp(Optimize(SyntheticPoseObservations(initial, 2, 0, 0.0, &random), initial), initial, 2);

  PoseObservations on_a_line;
  for (int i = 0; i < 10; ++i) {
    const Eigen::Vector3d x_in_cam(0.1 * i, 0.05 * i, 3.0);
    on_a_line.Add(initial.Inverse() * x_in_cam, SyntheticCamera().Project(x_in_cam), 1.0);
  }
  ExpectGivenUp(Optimize(on_a_line, initial), initial, 10);

  PoseObservations all_outliers = SyntheticPoseObservations(initial, 20, 20, 0.0, &random);
  PoseOptimizerOptions strict;
  strict.chi2 = 0.1;
  ExpectGivenUp(Optimize(all_outliers, initial, strict), initial, 20);
}

TEST(PoseOptimizer, InitialPoseThatIsNotFiniteGivesUp) {
  Random random(5);
  Rigid3 initial = TruePose();
  initial.translation.y() = kNan;
  const PoseEstimate estimate = Optimize(SyntheticPoseObservations(TruePose(), 20, 0, 0.0, &random), initial);
  EXPECT_FALSE(estimate.converged);
  EXPECT_EQ(estimate.inliers, 0);
}

TEST(PoseOptimizer, ReuseOfObjectsChangesNothing) {
  Random random(9);
  const PoseObservations big = SyntheticPoseObservations(TruePose(), 300, 60, 1.0, &random);
  const PoseObservations small = SyntheticPoseObservations(TruePose(), 50, 10, 1.0, &random);
  const Rigid3 initial = Perturbed(TruePose(), 0.01, 0.02, &random);
  PoseOptimizer reused{SyntheticCamera()};
  PoseEstimate estimate;
  reused.Optimize(big, initial, &estimate);
  reused.Optimize(small, initial, &estimate);
  const PoseEstimate fresh = Optimize(small, initial);
  EXPECT_EQ(estimate.cam_from_world.translation, fresh.cam_from_world.translation);
  EXPECT_EQ(estimate.is_inlier, fresh.is_inlier);
  EXPECT_EQ(estimate.information, fresh.information);
}

TEST(RightShare, IsFoundAmongMatchesByChance) {
  Random random(5);
  PoseOptimizerOptions options;
  for (const int right : {0, 2000, 5000, 10000}) {
    PoseEstimate estimate;
    double sum = 0;
    while (estimate.inliers < 10000) {
      const double u = random.Gaussian(), v = random.Gaussian();
      const double e2 = estimate.inliers < right ? u * u + v * v : random.Uniform(0, options.chi2);
      if (e2 > options.chi2) continue;
      sum += e2;
      ++estimate.inliers;
    }
    estimate.rms_px = std::sqrt(sum / estimate.inliers);
    EXPECT_NEAR(RightShare(estimate, options.chi2), right / 10000.0, 0.04) << right;
  }
}

TEST(RightShare, IsAllOfWhatIsNearerThanItsSigmaAndNothingOfWhatIsFarther) {
  PoseEstimate estimate;
  EXPECT_EQ(RightShare(estimate, 5.991), 0);
  estimate.inliers = 50;
  estimate.rms_px = 0.5;
  EXPECT_EQ(RightShare(estimate, 5.991), 1);
  estimate.rms_px = std::sqrt(5.991);
  EXPECT_EQ(RightShare(estimate, 5.991), 0);
}

}  // namespace
}  // namespace dynamic_slam
