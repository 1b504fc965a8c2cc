#include "dynamic_slam/optimize/pose_graph.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

constexpr size_t kNodes = 40;

// Cameras around a circle, looking outwards.
Sim3 TruePose(size_t i) {
  const double angle = 2 * std::numbers::pi * static_cast<double>(i) / kNodes;
  const Eigen::Quaterniond turn = ExpSo3({0, angle, 0});
  return {1, turn, -(turn * Eigen::Vector3d(5 * std::sin(angle), 0, 5 * std::cos(angle)))};
}

Sim3 TrueEdge(size_t first, size_t second) { return TruePose(first) * TruePose(second).Inverse(); }

// What odometry with a drift of scale and of heading makes of the circle.
PoseGraph DriftedCircle() {
  PoseGraph graph;
  const Sim3 drift{1.01, ExpSo3({0, 0.004, 0}), {0, 0.01, 0}};
  for (uint32_t i = 0; i < kNodes; ++i) {
    if (i == 0) {
      graph.nodes.push_back({TruePose(0), true});
      continue;
    }
    const Sim3 measured = drift * TrueEdge(i, i - 1);
    graph.nodes.push_back({measured * graph.nodes.back().node_from_world, false});
    graph.edges.push_back({i, i - 1, measured, 1});
  }
  return graph;
}

double WorstDistance(const PoseGraph& graph) {
  double worst = 0;
  for (size_t i = 0; i < kNodes; ++i) {
    const Eigen::Vector3d center = graph.nodes[i].node_from_world.Inverse().translation;
    worst = std::max(worst, (center - TruePose(i).Inverse().translation).norm());
  }
  return worst;
}

TEST(PoseGraphTest, ALoopTakesTheDriftOfScaleAway) {
  PoseGraph graph = DriftedCircle();
  const double before = WorstDistance(graph);
  EXPECT_GT(before, 1);
  graph.edges.push_back({kNodes - 1, 0, TrueEdge(kNodes - 1, 0), 100});
  const PoseGraphSummary summary = OptimizePoseGraph(50, {}, &graph);
  EXPECT_TRUE(summary.usable);
  EXPECT_LT(summary.final_cost, 0.1 * summary.initial_cost);
  EXPECT_NEAR(graph.nodes.back().node_from_world.scale, 1, 0.01);
  EXPECT_LT(WorstDistance(graph), 0.3 * before);
  EXPECT_EQ(graph.nodes[0].node_from_world.scale, 1);
}

TEST(PoseGraphTest, WithoutALoopNothingMoves) {
  PoseGraph graph = DriftedCircle();
  const double before = WorstDistance(graph);
  EXPECT_TRUE(OptimizePoseGraph(50, {}, &graph).usable);
  EXPECT_NEAR(WorstDistance(graph), before, 1e-6);
}

TEST(PoseGraphTest, TheWeakestEdgeGivesWay) {
  PoseGraph graph = DriftedCircle();
  // Nothing drifts but one edge, which is known to be weak.
  for (uint32_t i = 1; i < kNodes; ++i) {
    PoseGraph::Edge& edge = graph.edges[i - 1];
    edge.weight = i == 20 ? 1 : 1000;
    edge.first_from_second =
        (i == 20 ? Sim3{1.3, ExpSo3({0, 0.1, 0}), Eigen::Vector3d::Zero()} : Sim3()) * TrueEdge(i, i - 1);
    graph.nodes[i].node_from_world = edge.first_from_second * graph.nodes[i - 1].node_from_world;
  }
  EXPECT_GT(WorstDistance(graph), 0.5);
  graph.edges.push_back({kNodes - 1, 0, TrueEdge(kNodes - 1, 0), 1000});
  EXPECT_TRUE(OptimizePoseGraph(50, {}, &graph).usable);
  EXPECT_LT(WorstDistance(graph), 0.1);
}

TEST(PoseGraphTest, StopsAndLeavesEverythingAsItWas) {
  PoseGraph graph = DriftedCircle();
  graph.edges.push_back({kNodes - 1, 0, TrueEdge(kNodes - 1, 0), 100});
  const double before = WorstDistance(graph);
  const PoseGraphSummary summary = OptimizePoseGraph(
      50, [] { return true; }, &graph);
  EXPECT_TRUE(summary.stopped);
  EXPECT_FALSE(summary.usable);
  EXPECT_EQ(WorstDistance(graph), before);
}

TEST(PoseGraphTest, SomethingMustBeFixed) {
  PoseGraph graph = DriftedCircle();
  graph.nodes[0].fixed = false;
  EXPECT_THROW(OptimizePoseGraph(5, {}, &graph), InternalError);
}

}  // namespace
}  // namespace dynamic_slam
