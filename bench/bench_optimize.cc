#include <utility>
#include <vector>

#include <benchmark/benchmark.h>

#include "dynamic_slam/geometry/triangulation.h"
#include "dynamic_slam/map/landmark_projector.h"
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
BENCHMARK(BM_PoseOptimizer)
    ->Args({300, 20})
    ->Args({500, 20})
    ->Args({1000, 20})
    ->Unit(benchmark::kMicrosecond);

// A local window with four to five observations for each point, 2% of them wrong.
BundleProblem LocalWindow(int fixed_poses, int free_poses, int points) {
  Random random(1);
  SyntheticBundleOptions scene;
  scene.fixed_poses = fixed_poses;
  scene.free_poses = free_poses;
  scene.points = points;
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
  const BundleProblem problem = LocalWindow(20, 20, 2500);
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

// Arguments: poses that are fixed, and free, and points.
void BM_LocalBundle(benchmark::State& state) {
  const BundleProblem problem = LocalWindow(
      static_cast<int>(state.range(0)), static_cast<int>(state.range(1)), static_cast<int>(state.range(2)));
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
BENCHMARK(BM_LocalBundle)->Args({20, 20, 2500})->Args({2, 18, 3200})->Unit(benchmark::kMillisecond);

void BM_Triangulate(benchmark::State& state) {
  Random random(1);
  const Rigid3 second_from_first(ExpSo3({0.02, -0.03, 0.01}), {-0.2, 0.01, 0.02});
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> rays;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d point = Eigen::Vector3d(0, 0, 4) + GaussianVector(&random, 1);
    const Eigen::Vector3d in_second = second_from_first * point;
    rays.emplace_back(point / point.z(), in_second / in_second.z());
  }
  const TwoViewTriangulator triangulator(second_from_first);
  for (auto _ : state) {
    for (const auto& [first, second] : rays) {
      benchmark::DoNotOptimize(triangulator.Triangulate(first, second));
    }
  }
}
BENCHMARK(BM_Triangulate)->Unit(benchmark::kMillisecond);

// 5,000 landmarks, most of them in view, as a frame asks about its local map.
void BM_Project(benchmark::State& state) {
  Random random(1);
  std::vector<float> scales(8, 1.0f);
  for (size_t i = 1; i < scales.size(); ++i) scales[i] = 1.2f * scales[i - 1];
  LandmarkProjector projector(SyntheticCamera(), scales);
  projector.SetPose(Rigid3());
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 5000; ++i) points.push_back(Eigen::Vector3d(0, 0, 4) + GaussianVector(&random, 1));
  for (auto _ : state) {
    size_t in_view = 0;
    for (const Eigen::Vector3d& point : points) {
      LandmarkProjection projection;
      in_view += projector.Project(point, point.normalized().cast<float>(), 0.5f, 10.0f, &projection);
    }
    benchmark::DoNotOptimize(in_view);
  }
}
BENCHMARK(BM_Project)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace dynamic_slam
