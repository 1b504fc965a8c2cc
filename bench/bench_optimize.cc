#include <benchmark/benchmark.h>

#include "dynamic_slam/optimize/bundle_adjustment.h"
#include "dynamic_slam/optimize/bundle_solvers.h"
#include "dynamic_slam/optimize/pose_optimizer.h"
#include "dynamic_slam/optimize/synthetic_bundle.h"

namespace dynamic_slam {
namespace {

// Arguments: points, percentage of outliers.
void BM_PoseOptimizer(benchmark::State& state) {
  Random random(1);
  const Rigid3 pose(ExpSo3({0.3, -0.5, 0.2}), {1, -2, 3});
  const int points = static_cast<int>(state.range(0));
  const PoseObservations observations =
      SyntheticPoseObservations(pose, points, points * static_cast<int>(state.range(1)) / 100, 1.0, &random);
  const Rigid3 initial = Perturbed(pose, 0.01, 0.02, &random);
  PoseOptimizer optimizer{SyntheticCamera()};
  PoseEstimate estimate;
  for (auto _ : state) {
    optimizer.Optimize(observations, initial, &estimate);
    benchmark::DoNotOptimize(estimate.inliers);
  }
  state.counters["inliers"] = estimate.inliers;
}
BENCHMARK(BM_PoseOptimizer)->Args({300, 0})->Args({300, 20})->Args({1000, 20})->Unit(benchmark::kMicrosecond);

// A local window: 20 free and 20 fixed poses, 2500 points, about 12000 observations, 2% of them wrong.
BundleProblem LocalWindow() {
  Random random(1);
  SyntheticBundleOptions scene;
  scene.fixed_poses = 20;
  scene.free_poses = 20;
  scene.points = 2500;
  scene.noise_px = 1.0;
  scene.pose_error = 0.003;
  scene.point_error = 0.03;
  BundleProblem problem = SyntheticBundle(scene, &random, nullptr);
  for (size_t i = 0; i < problem.observations.size(); i += 50) {
    problem.observations[i].ideal_px += Eigen::Vector2d(30, -20);
  }
  return problem;
}

// One round of five steps by one solver.
template <auto Solve>
void BM_BundleSolver(benchmark::State& state) {
  const BundleProblem problem = LocalWindow();
  BundleSolverOptions options;
  options.huber_chi2 = 5.991;
  options.max_iterations = 5;
  options.function_tolerance = 0;
  const std::vector<uint8_t> skip(problem.observations.size(), 0);
  for (auto _ : state) {
    BundleProblem copy = problem;
    benchmark::DoNotOptimize(Solve(SyntheticCamera(), options, {}, skip, &copy));
  }
}
BENCHMARK(BM_BundleSolver<SolveDenseSchur>)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_BundleSolver<SolveSparseSchur>)->Unit(benchmark::kMillisecond);

void BM_LocalBundle(benchmark::State& state) {
  const BundleProblem problem = LocalWindow();
  BundleSummary summary;
  std::vector<uint8_t> is_outlier;
  for (auto _ : state) {
    BundleProblem copy = problem;
    summary = AdjustBundle(SyntheticCamera(), {}, nullptr, &copy, &is_outlier);
  }
  state.counters["observations"] = static_cast<double>(problem.observations.size());
  state.counters["iterations"] = summary.iterations;
  state.counters["final_cost"] = summary.final_cost;
  state.counters["outliers"] = summary.outliers;
}
BENCHMARK(BM_LocalBundle)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace dynamic_slam
