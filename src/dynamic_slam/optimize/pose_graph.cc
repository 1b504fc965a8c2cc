#include "dynamic_slam/optimize/pose_graph.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <ceres/autodiff_cost_function.h>
#include <ceres/iteration_callback.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>
#include <ceres/solver.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

// A node is an increment to where it began, applied from the left: rotation vector, translation, logarithm of
// the scale.
constexpr int kBlock = 7;
using Block = std::array<double, kBlock>;

template <class T>
struct Similarity {
  T scale;
  T rotation[4];  // w x y z
  T translation[3];
};

template <class T>
Similarity<T> FromSim3(const Sim3& s) {
  return {T(s.scale),
          {T(s.rotation.w()), T(s.rotation.x()), T(s.rotation.y()), T(s.rotation.z())},
          {T(s.translation.x()), T(s.translation.y()), T(s.translation.z())}};
}

template <class T>
Similarity<T> FromIncrement(const T* block) {
  using std::exp;
  Similarity<T> s{exp(block[6]), {}, {block[3], block[4], block[5]}};
  ceres::AngleAxisToQuaternion(block, s.rotation);
  return s;
}

template <class T>
Similarity<T> Multiply(const Similarity<T>& a, const Similarity<T>& b) {
  Similarity<T> product{a.scale * b.scale, {}, {}};
  ceres::QuaternionProduct(a.rotation, b.rotation, product.rotation);
  T turned[3];
  ceres::UnitQuaternionRotatePoint(a.rotation, b.translation, turned);
  for (int i = 0; i < 3; ++i) product.translation[i] = a.scale * turned[i] + a.translation[i];
  return product;
}

template <class T>
Similarity<T> Invert(const Similarity<T>& a) {
  Similarity<T> inverse{T(1) / a.scale, {a.rotation[0], -a.rotation[1], -a.rotation[2], -a.rotation[3]}, {}};
  T turned[3];
  ceres::UnitQuaternionRotatePoint(inverse.rotation, a.translation, turned);
  for (int i = 0; i < 3; ++i) inverse.translation[i] = -turned[i] * inverse.scale;
  return inverse;
}

struct EdgeError {
  Sim3 measured, first, second;  // where the nodes began
  double root_weight;

  template <class T>
  bool operator()(const T* first_block, const T* second_block, T* residuals) const {
    using std::log;
    const Similarity<T> first_from_world = Multiply(FromIncrement(first_block), FromSim3<T>(first));
    const Similarity<T> second_from_world = Multiply(FromIncrement(second_block), FromSim3<T>(second));
    const Similarity<T> error =
        Multiply(Multiply(FromSim3<T>(measured), second_from_world), Invert(first_from_world));
    ceres::QuaternionToAngleAxis(error.rotation, residuals);
    for (int i = 0; i < 3; ++i) residuals[3 + i] = error.translation[i];
    residuals[6] = log(error.scale);
    for (int i = 0; i < kBlock; ++i) residuals[i] *= T(root_weight);
    return true;
  }
};

class StopCallback : public ceres::IterationCallback {
 public:
  explicit StopCallback(const std::function<bool()>& should_stop) : should_stop_(should_stop) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    return should_stop_ && should_stop_() ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }

 private:
  const std::function<bool()>& should_stop_;
};

}  // namespace

PoseGraphSummary OptimizePoseGraph(int max_iterations, const std::function<bool()>& should_stop,
                                   PoseGraph* graph) {
  DS_CHECK(std::any_of(graph->nodes.begin(), graph->nodes.end(), [](const auto& node) { return node.fixed; }),
           "{} nodes", graph->nodes.size());
  std::vector<Block> blocks(graph->nodes.size(), Block{});
  ceres::Problem problem;
  for (const PoseGraph::Edge& edge : graph->edges) {
    DS_CHECK(edge.first < blocks.size() && edge.second < blocks.size() && edge.first != edge.second, "{} {}",
             edge.first, edge.second);
    auto* error = new EdgeError{edge.first_from_second, graph->nodes[edge.first].node_from_world,
                                graph->nodes[edge.second].node_from_world, std::sqrt(edge.weight)};
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<EdgeError, kBlock, kBlock, kBlock>(error),
                             nullptr, blocks[edge.first].data(), blocks[edge.second].data());
  }
  for (size_t i = 0; i < blocks.size(); ++i) {
    if (graph->nodes[i].fixed && problem.HasParameterBlock(blocks[i].data())) {
      problem.SetParameterBlockConstant(blocks[i].data());
    }
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = max_iterations;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  StopCallback callback(should_stop);
  options.callbacks.push_back(&callback);
  ceres::Solver::Summary solved;
  ceres::Solve(options, &problem, &solved);

  PoseGraphSummary summary;
  summary.initial_cost = solved.initial_cost;
  summary.final_cost = solved.final_cost;
  summary.iterations = static_cast<int>(solved.iterations.size());
  summary.stopped = solved.termination_type == ceres::USER_FAILURE;
  summary.usable = solved.IsSolutionUsable() && !summary.stopped;
  if (!summary.usable) return summary;
  for (size_t i = 0; i < blocks.size(); ++i) {
    if (graph->nodes[i].fixed) continue;
    const Block& block = blocks[i];
    const Sim3 increment{
        std::exp(block[6]), ExpSo3({block[0], block[1], block[2]}), {block[3], block[4], block[5]}};
    graph->nodes[i].node_from_world = increment * graph->nodes[i].node_from_world;
  }
  return summary;
}

}  // namespace dynamic_slam
