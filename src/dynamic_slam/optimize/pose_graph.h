#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "dynamic_slam/geometry/sim3.h"

namespace dynamic_slam {

// Similarities of cameras and what is known of pairs of them. A node's scale is the length, in the node's own
// unit, of what is one unit long in the world.
struct PoseGraph {
  struct Node {
    Sim3 node_from_world;
    bool fixed = false;
  };
  struct Edge {
    uint32_t first = 0, second = 0;  // indices in nodes
    Sim3 first_from_second;          // as measured, in their own units
    double weight = 1;               // inverse variance, up to a common factor
  };

  std::vector<Node> nodes;
  std::vector<Edge> edges;
};

struct PoseGraphSummary {
  double initial_cost = 0, final_cost = 0;
  int iterations = 0;
  bool usable = false;   // false: nothing was changed
  bool stopped = false;  // should_stop ended it: nothing was changed either
};

// Moves and scales the nodes so that the edges fit: the sum over the edges of weight * |error|^2 is least,
// where the error of an edge is the rotation vector (rad), the translation (in units of the first node) and
// the logarithm of the scale of first_from_second * second_from_world * world_from_first (Strasdat, Montiel
// and Davison, "Scale drift-aware large scale monocular SLAM", 2010). At least one node must be fixed
// (InternalError).
PoseGraphSummary OptimizePoseGraph(int max_iterations, const std::function<bool()>& should_stop,
                                   PoseGraph* graph);

}  // namespace dynamic_slam
