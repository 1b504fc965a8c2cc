#include "dynamic_slam/optimize/bundle_solvers.h"

#include <limits>

#include <gtest/gtest.h>

#include "dynamic_slam/optimize/synthetic_bundle.h"

namespace dynamic_slam {
namespace {

struct Solved {
  BundleProblem problem;
  BundleSolverResult result;
};

template <class Solver>
Solved Solve(Solver solver, BundleProblem problem, const BundleSolverOptions& options) {
  Solved solved;
  const std::vector<uint8_t> skip(problem.observations.size(), 0);
  solved.result = solver(SyntheticCamera(), options, {}, skip, &problem);
  solved.problem = std::move(problem);
  return solved;
}

double Cost(const BundleProblem& problem, double huber_chi2) {
  double cost = 0;
  for (const BundleProblem::Observation& observation : problem.observations) {
    const Eigen::Vector3d x =
        problem.poses[observation.pose].cam_from_world * problem.points[observation.point].position;
    const double squared_error = (SyntheticCamera().Project(x) - observation.ideal_px).squaredNorm() *
                                 observation.inverse_sigma_px * observation.inverse_sigma_px;
    cost += 0.5 * observation.weight * HuberLoss(squared_error, huber_chi2);
  }
  for (const BundleProblem::Motion& motion : problem.motions) {
    const auto centre = [&](int k) {
      return problem.poses[motion.poses[k]].cam_from_world.TargetOriginInSource();
    };
    const Eigen::Vector3d change =
        (centre(2) - centre(1)) / motion.second_s - motion.turn * (centre(1) - centre(0)) / motion.first_s;
    cost += 0.5 * (motion.inverse_sigma * change).squaredNorm();
  }
  return cost;
}

class BundleSolversTest : public ::testing::TestWithParam<double> {
 protected:
  static void ExpectTheSameMinimum(double huber_chi2, bool with_motions);
};

void BundleSolversTest::ExpectTheSameMinimum(double huber_chi2, bool with_motions) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    SyntheticBundleOptions scene;
    scene.noise_px = 1.0;
    scene.free_poses = 3 + 4 * static_cast<int>(seed);
    BundleProblem problem = SyntheticBundle(scene, &random, nullptr);
    for (size_t i = 0; i < problem.observations.size(); ++i) {
      problem.observations[i].weight = random.Uniform(0.2, 1.0);
      problem.observations[i].inverse_sigma_px = random.Uniform(0.3, 1.0);
      if (std::isfinite(huber_chi2) && i % 20 == 0)
        problem.observations[i].ideal_px += Eigen::Vector2d(15, -9);
    }
    for (size_t i = 0; i < problem.points.size(); i += 10) problem.points[i].fixed = true;
    problem.poses[4].fixed = true;
    // Of every second pose from one of the fixed on.
    for (uint32_t i = 1; with_motions && i + 4 < problem.poses.size(); ++i) {
      BundleProblem::Motion motion{{i, i + 2, i + 4}, 0.1, random.Uniform(0.05, 0.2), random.Uniform(1, 5)};
      motion.turn = ExpSo3(GaussianVector(&random, 0.1)).toRotationMatrix();
      problem.motions.push_back(motion);
    }
    BundleSolverOptions options;
    options.huber_chi2 = huber_chi2;
    options.max_iterations = 100;
    options.function_tolerance = 1e-12;
    const Solved dense = Solve(SolveDenseSchur, problem, options);
    const Solved sparse = Solve(SolveSparseSchur, problem, options);
    ASSERT_TRUE(dense.result.usable && sparse.result.usable);
    const double dense_cost = Cost(dense.problem, huber_chi2), sparse_cost = Cost(sparse.problem, huber_chi2);
    EXPECT_LT(dense_cost, 0.5 * Cost(problem, huber_chi2));
    EXPECT_NEAR(dense_cost, sparse_cost, 1e-6 * sparse_cost) << "seed " << seed;
    for (size_t i = 0; i < problem.poses.size(); ++i) {
      const Rigid3 difference =
          dense.problem.poses[i].cam_from_world * sparse.problem.poses[i].cam_from_world.Inverse();
      EXPECT_LT(LogSo3(difference.rotation).norm(), 1e-4);
      EXPECT_LT(difference.translation.norm(), 1e-3);
    }
    EXPECT_LT(dense.result.iterations, options.max_iterations) << "it has converged";
  }
}

TEST_P(BundleSolversTest, BothFindTheSameMinimum) { ExpectTheSameMinimum(GetParam(), false); }

TEST_P(BundleSolversTest, WithMotionsToo) { ExpectTheSameMinimum(GetParam(), true); }

INSTANTIATE_TEST_SUITE_P(Losses, BundleSolversTest,
                         ::testing::Values(5.991, std::numeric_limits<double>::infinity()));

TEST(DenseSchurTest, APointSeenTwiceByOnePoseCountsTwice) {
  Random random(3);
  SyntheticBundleOptions scene;
  scene.noise_px = 1.0;
  BundleProblem problem = SyntheticBundle(scene, &random, nullptr);
  const size_t count = problem.observations.size();
  for (size_t i = 0; i < count; i += 2) problem.observations.push_back(problem.observations[i]);
  BundleSolverOptions options;
  options.huber_chi2 = std::numeric_limits<double>::infinity();
  options.max_iterations = 100;
  options.function_tolerance = 1e-12;
  const Solved dense = Solve(SolveDenseSchur, problem, options);
  const Solved sparse = Solve(SolveSparseSchur, problem, options);
  EXPECT_NEAR(Cost(dense.problem, options.huber_chi2), Cost(sparse.problem, options.huber_chi2), 1e-6);
}

TEST(DenseSchurTest, EachStepLowersTheCost) {
  Random random(4);
  SyntheticBundleOptions scene;
  scene.noise_px = 0.5;
  scene.pose_error = 0.1;
  scene.point_error = 0.5;
  const BundleProblem problem = SyntheticBundle(scene, &random, nullptr);
  BundleSolverOptions options;
  options.huber_chi2 = 5.991;
  double last = Cost(problem, options.huber_chi2);
  for (options.max_iterations = 1; options.max_iterations <= 8; ++options.max_iterations) {
    const double cost = Cost(Solve(SolveDenseSchur, problem, options).problem, options.huber_chi2);
    EXPECT_LE(cost, last);
    last = cost;
  }
  EXPECT_LT(last, 0.05 * Cost(problem, options.huber_chi2));
}

}  // namespace
}  // namespace dynamic_slam
