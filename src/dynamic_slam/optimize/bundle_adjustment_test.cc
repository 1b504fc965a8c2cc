#include "dynamic_slam/optimize/bundle_adjustment.h"

#include <cstring>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/optimize/bundle_solvers.h"
#include "dynamic_slam/optimize/synthetic_bundle.h"

namespace dynamic_slam {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Result {
  BundleSummary summary;
  std::vector<uint8_t> is_outlier;
};

Result Adjust(BundleProblem* problem, const BundleOptions& options = {},
              const std::function<bool()>& should_stop = nullptr) {
  Result result;
  result.summary = AdjustBundle(SyntheticCamera(), options, should_stop, problem, &result.is_outlier);
  return result;
}

BundleOptions Thorough() {
  BundleOptions options;
  options.max_iterations = 50;
  options.refine_iterations = 50;
  options.function_tolerance = 1e-14;
  return options;
}

double LargestPoseError(const BundleProblem& a, const BundleProblem& b) {
  double largest = 0;
  for (size_t i = 0; i < a.poses.size(); ++i) {
    const Rigid3 &x = a.poses[i].cam_from_world, &y = b.poses[i].cam_from_world;
    largest =
        std::max({largest, RotationAngle(x.rotation, y.rotation), (x.translation - y.translation).norm()});
  }
  return largest;
}

double LargestPointError(const BundleProblem& a, const BundleProblem& b) {
  double largest = 0;
  for (size_t i = 0; i < a.points.size(); ++i) {
    largest = std::max(largest, (a.points[i].position - b.points[i].position).norm());
  }
  return largest;
}

bool SameBytes(const Rigid3& a, const Rigid3& b) {
  return std::memcmp(a.rotation.coeffs().data(), b.rotation.coeffs().data(), 4 * sizeof(double)) == 0 &&
         std::memcmp(a.translation.data(), b.translation.data(), 3 * sizeof(double)) == 0;
}

bool SameBytes(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::memcmp(a.data(), b.data(), 3 * sizeof(double)) == 0;
}

bool AllFinite(const BundleProblem& problem) {
  for (const BundleProblem::Pose& pose : problem.poses) {
    if (!pose.cam_from_world.IsFinite()) return false;
  }
  for (const BundleProblem::Point& point : problem.points) {
    if (!point.position.allFinite()) return false;
  }
  return true;
}

TEST(AdjustBundle, ExactPixelsGiveTheTruth) {
  Random random(1);
  BundleProblem truth;
  BundleProblem problem = SyntheticBundle({}, &random, &truth);
  ASSERT_GT(LargestPointError(problem, truth), 0.1);
  const Result result = Adjust(&problem, Thorough());
  EXPECT_TRUE(result.summary.usable);
  EXPECT_FALSE(result.summary.stopped);
  EXPECT_EQ(result.summary.outliers, 0);
  EXPECT_LT(result.summary.final_cost, 1e-10);
  EXPECT_LT(LargestPoseError(problem, truth), 1e-6);
  EXPECT_LT(LargestPointError(problem, truth), 1e-4);
}

TEST(AdjustBundle, DefaultsLeaveTheErrorOfTheKeypoints) {
  Random random(2);
  SyntheticBundleOptions scene;
  scene.noise_px = 1.0;
  scene.points = 500;
  BundleProblem truth;
  BundleProblem problem = SyntheticBundle(scene, &random, &truth);
  BundleOptions options;
  options.chi2 = 50;  // no inlier is taken for an outlier
  const Result result = Adjust(&problem, options);
  ASSERT_TRUE(result.summary.usable);
  EXPECT_EQ(result.summary.outliers, 0);
  const double unknowns = 6.0 * scene.free_poses + 3.0 * scene.points;
  const double expected = 0.5 * (2.0 * static_cast<double>(problem.observations.size()) - unknowns);
  EXPECT_NEAR(result.summary.final_cost, expected, 0.1 * expected);  // four sigmas
  EXPECT_LT(result.summary.final_cost, 0.1 * result.summary.initial_cost);
  EXPECT_LT(LargestPoseError(problem, truth), 0.05);
}

TEST(AdjustBundle, FindsOutliersAndIsNotMovedByThem) {
  Random random(3);
  SyntheticBundleOptions scene;
  scene.noise_px = 0.3;
  BundleProblem truth;
  BundleProblem problem = SyntheticBundle(scene, &random, &truth);
  std::vector<uint8_t> is_wrong(problem.observations.size(), 0);
  for (size_t i = 0; i < problem.observations.size(); i += 25) {
    is_wrong[i] = 1;
    problem.observations[i].ideal_px += Eigen::Vector2d(40, -30);
  }
  const Result result = Adjust(&problem);
  ASSERT_TRUE(result.summary.usable);
  int missed = 0, wrongly_named = 0, named = 0;
  for (size_t i = 0; i < is_wrong.size(); ++i) {
    missed += is_wrong[i] && !result.is_outlier[i];
    wrongly_named += !is_wrong[i] && result.is_outlier[i];
    named += result.is_outlier[i];
  }
  EXPECT_EQ(missed, 0);
  EXPECT_LE(wrongly_named, static_cast<int>(is_wrong.size()) / 100);
  EXPECT_EQ(result.summary.outliers, named);
  EXPECT_LT(LargestPoseError(problem, truth), 0.01);
}

TEST(AdjustBundle, FixedValuesKeepTheirBytes) {
  Random random(4);
  SyntheticBundleOptions scene;
  scene.noise_px = 1.0;
  BundleProblem problem = SyntheticBundle(scene, &random, nullptr);
  for (size_t i = 0; i < problem.points.size(); i += 3) problem.points[i].fixed = true;
  problem.poses[5].fixed = true;
  const BundleProblem before = problem;
  ASSERT_TRUE(Adjust(&problem).summary.usable);
  for (size_t i = 0; i < problem.poses.size(); ++i) {
    EXPECT_EQ(SameBytes(problem.poses[i].cam_from_world, before.poses[i].cam_from_world),
              problem.poses[i].fixed);
  }
  for (size_t i = 0; i < problem.points.size(); ++i) {
    EXPECT_EQ(SameBytes(problem.points[i].position, before.points[i].position), problem.points[i].fixed);
  }
}

TEST(AdjustBundle, SolvesPosesOrPointsAlone) {
  for (const bool fix_points : {true, false}) {
    Random random(5);
    BundleProblem truth;
    BundleProblem problem = SyntheticBundle({}, &random, &truth);
    if (fix_points) {
      problem.points = truth.points;
      for (BundleProblem::Point& point : problem.points) point.fixed = true;
    } else {
      problem.poses = truth.poses;
      for (BundleProblem::Pose& pose : problem.poses) pose.fixed = true;
    }
    ASSERT_TRUE(Adjust(&problem, Thorough()).summary.usable);
    EXPECT_LT(LargestPoseError(problem, truth), 1e-8);
    EXPECT_LT(LargestPointError(problem, truth), 1e-5);
  }
}

TEST(AdjustBundle, TwiceGivesTheSameBytes) {
  const auto adjust = [] {
    Random random(6);
    SyntheticBundleOptions scene;
    scene.noise_px = 1.0;
    BundleProblem problem = SyntheticBundle(scene, &random, nullptr);
    Adjust(&problem);
    return problem;
  };
  const BundleProblem a = adjust(), b = adjust();
  for (size_t i = 0; i < a.poses.size(); ++i) {
    EXPECT_TRUE(SameBytes(a.poses[i].cam_from_world, b.poses[i].cam_from_world));
  }
  for (size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_TRUE(SameBytes(a.points[i].position, b.points[i].position));
  }
}

TEST(AdjustBundle, StopsWhenToldAndKeepsTheStepsSoFar) {
  Random random(7);
  SyntheticBundleOptions scene;
  scene.noise_px = 1.0;
  BundleProblem problem = SyntheticBundle(scene, &random, nullptr);
  int asked = 0;
  const Result result = Adjust(&problem, {}, [&] { return ++asked >= 2; });
  EXPECT_TRUE(result.summary.stopped);
  EXPECT_TRUE(result.summary.usable);
  EXPECT_LE(result.summary.iterations, 1);
  EXPECT_EQ(asked, 2);
  EXPECT_LT(result.summary.final_cost, result.summary.initial_cost);
  EXPECT_EQ(result.is_outlier.size(), problem.observations.size());
  EXPECT_TRUE(AllFinite(problem));
}

TEST(AdjustBundle, StoppedAtOnceItSaysNothingOfTheObservations) {
  for (const int free_poses : {8, 250}) {  // of both solvers
    Random random(7);
    SyntheticBundleOptions scene;
    scene.free_poses = free_poses;
    scene.points = 20 * free_poses;
    BundleProblem problem = SyntheticBundle(scene, &random, nullptr);
    const Result result = Adjust(&problem, {}, [] { return true; });
    EXPECT_TRUE(result.summary.stopped);
    EXPECT_EQ(result.summary.iterations, 0);
    EXPECT_EQ(result.summary.outliers, 0) << "far from what they become, most are off";
    EXPECT_THAT(result.is_outlier, testing::Each(0));
  }
}

TEST(AdjustBundle, WeightsDecideBetweenTwoExplanations) {
  const auto point_error = [](double trust_in_wrong) {
    Random random(8);
    BundleProblem truth;
    BundleProblem problem = SyntheticBundle({}, &random, &truth);
    problem.poses = truth.poses;
    for (BundleProblem::Pose& pose : problem.poses) pose.fixed = true;
    for (BundleProblem::Observation& observation : problem.observations) {
      if (observation.pose % 2 == 0) continue;
      observation.ideal_px.y() += 1.0;
      observation.weight = trust_in_wrong;
    }
    Adjust(&problem, Thorough());
    double sum = 0;
    for (size_t i = 0; i < problem.points.size(); ++i) {
      sum += std::abs(problem.points[i].position.y() - truth.points[i].position.y());
    }
    return sum / static_cast<double>(problem.points.size());
  };
  EXPECT_LT(point_error(0.01), 0.5 * point_error(1.0));
  EXPECT_LT(point_error(1.0), 0.7 * point_error(100.0));
}

TEST(AdjustBundle, WeightOfZeroIsNotUsed) {
  Random random(9);
  BundleProblem truth;
  BundleProblem problem = SyntheticBundle({}, &random, &truth);
  problem.observations[10].ideal_px += Eigen::Vector2d(3, 3);
  problem.observations[10].weight = 0;
  problem.observations[11].weight = 0;  // though it fits
  problem.observations[12].weight = -1;
  const Result result = Adjust(&problem, Thorough());
  EXPECT_EQ(result.summary.outliers, 3);
  for (const size_t i : {10, 11, 12}) EXPECT_EQ(result.is_outlier[i], 1) << i;
  EXPECT_LT(LargestPoseError(problem, truth), 1e-6);
}

TEST(AdjustBundle, CostAndOutliersAreInSigmasAndWeights) {
  Random random(9);
  BundleProblem problem;
  SyntheticBundle({}, &random, &problem);
  for (BundleProblem::Pose& pose : problem.poses) pose.fixed = true;
  for (BundleProblem::Point& point : problem.points) point.fixed = true;
  problem.points.push_back({problem.poses[0].cam_from_world.Inverse() * Eigen::Vector3d(0, 0, -4), true});
  problem.observations.push_back({0, static_cast<uint32_t>(problem.points.size() - 1), {300, 200}});
  for (const size_t i : {0, 1}) problem.observations[i].ideal_px.x() += 4;
  problem.observations[0].inverse_sigma_px = 0.5;
  problem.observations[0].weight = 0.25;
  const BundleOptions options;
  const Result result = Adjust(&problem, options);
  EXPECT_EQ(result.is_outlier[0], 0) << "two sigmas";
  EXPECT_EQ(result.is_outlier[1], 1) << "four sigmas";
  EXPECT_EQ(result.summary.outliers, 2);
  EXPECT_NEAR(result.summary.initial_cost, 0.5 * 0.25 * 4 + 0.5 * HuberLoss(16, options.chi2), 1e-6)
      << "what is behind the camera has no part in it";
}

TEST(AdjustBundle, WithoutRejectionThereIsNoRoundWithoutOutliers) {
  const auto adjust = [](const BundleOptions& options) {
    Random random(3);
    BundleProblem problem = SyntheticBundle({}, &random, nullptr);
    for (size_t i = 0; i < problem.observations.size(); i += 25) {
      problem.observations[i].ideal_px += Eigen::Vector2d(40, -30);
    }
    Adjust(&problem, options);
    return problem.poses.back().cam_from_world;
  };
  BundleOptions keeps, one_round;
  keeps.reject_outliers = false;
  one_round.refine_iterations = 0;
  EXPECT_TRUE(SameBytes(adjust(keeps), adjust(one_round)));
  EXPECT_FALSE(SameBytes(adjust(keeps), adjust({})));
}

TEST(AdjustBundle, PointsBehindACameraAreOutliersAndHarmNothing) {
  Random random(10);
  BundleProblem truth;
  BundleProblem problem = SyntheticBundle({}, &random, &truth);
  for (const double z : {-4.0, 0.0, -1e-9}) {
    problem.points.push_back(
        {problem.poses[0].cam_from_world.Inverse() * Eigen::Vector3d(0.1, 0.1, z), false});
    const auto point = static_cast<uint32_t>(problem.points.size() - 1);
    problem.observations.push_back({0, point, {300, 200}});
    problem.observations.push_back({5, point, {310, 210}});
  }
  truth.points = problem.points;
  const size_t count = problem.observations.size();
  const Result result = Adjust(&problem, Thorough());
  ASSERT_TRUE(result.summary.usable);
  for (size_t i = count - 6; i < count; i += 2) EXPECT_EQ(result.is_outlier[i], 1) << i;  // those of pose 0
  EXPECT_TRUE(AllFinite(problem));
  EXPECT_TRUE(std::isfinite(result.summary.initial_cost) && std::isfinite(result.summary.final_cost));
  EXPECT_LT(LargestPoseError(problem, truth), 1e-6);
}

TEST(AdjustBundle, ObservationsThatAreNotFiniteAreOutliers) {
  Random random(11);
  BundleProblem truth;
  BundleProblem problem = SyntheticBundle({}, &random, &truth);
  problem.observations[3].ideal_px.x() = kNan;
  problem.observations[4].inverse_sigma_px = kNan;
  problem.observations[5].weight = kNan;
  const Result result = Adjust(&problem, Thorough());
  EXPECT_TRUE(result.summary.usable);
  EXPECT_EQ(result.summary.outliers, 3);
  EXPECT_LT(LargestPoseError(problem, truth), 1e-6);
}

TEST(AdjustBundle, ValuesThatAreNotFiniteAreNotWrittenBack) {
  Random random(12);
  BundleProblem problem = SyntheticBundle({}, &random, nullptr);
  problem.poses[4].cam_from_world.translation.x() = kNan;
  const BundleProblem before = problem;
  const Result result = Adjust(&problem);
  EXPECT_FALSE(result.summary.usable);
  for (size_t i = 0; i < problem.points.size(); ++i) {
    EXPECT_TRUE(SameBytes(problem.points[i].position, before.points[i].position));
  }
}

TEST(AdjustBundle, NothingToSeeChangesNothing) {
  BundleProblem problem;
  problem.poses.push_back({Rigid3(), true});
  const Result result = Adjust(&problem);
  EXPECT_TRUE(result.summary.usable);
  EXPECT_EQ(result.summary.iterations, 0);
  EXPECT_EQ(result.summary.final_cost, 0);
}

TEST(AdjustBundle, ChecksWhatTheCallerMustKnow) {
  BundleProblem problem;
  problem.poses.push_back({Rigid3(), false});
  problem.points.push_back({});
  EXPECT_THROW(Adjust(&problem), InternalError);
  problem.points.assign(3, {{}, true});
  problem.points[2].fixed = false;
  EXPECT_THROW(Adjust(&problem), InternalError) << "a pose could turn about two points";
  problem.points[2].fixed = true;
  EXPECT_NO_THROW(Adjust(&problem));
  problem.points.resize(1);
  problem.poses[0].fixed = true;
  problem.observations.push_back({0, 1, {0, 0}});
  EXPECT_THROW(Adjust(&problem), InternalError);
  problem.observations[0] = {1, 0, {0, 0}};
  EXPECT_THROW(Adjust(&problem), InternalError);
}

}  // namespace
}  // namespace dynamic_slam
