#pragma once

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "dynamic_slam/loop/loop_detector.h"
#include "dynamic_slam/optimize/pose_graph.h"

namespace dynamic_slam {

// The essential graph of a part of the map (Mur-Artal et al. 2015, section III-D): a spanning tree over the
// keyframes, those that share much, and loops; and what its optimisation does to the map. Keyframes and
// landmarks that came in the meantime go along with what is around them.
//
// Scale is carried from keyframe to keyframe by the depths of the landmarks that they share. So these hold
// them together as far as their depths are certain: the drift of a loop goes to where there were few, or
// uncertain ones.
class LoopCorrection {
 public:
  // older_loops: pairs of keyframes to hold together.
  LoopCorrection(const Camera& camera, const Map& map, const Loop& loop, const LoopOptions& options,
                 const std::vector<std::pair<KeyframeId, KeyframeId>>& older_loops);

  // False when it was stopped or failed.
  bool Solve(const std::function<bool()>& should_stop);

  // Moves everything; the caller has seen that the epoch and the revision are those of before.
  void Apply(Map* map) const;

 private:
  bool HasNode(KeyframeId keyframe) const;
  void AddKeyframe(const Map& map, const Keyframe& keyframe, KeyframeId previous);
  void AddLoop(const Map& map, const Loop& loop);
  void AddEdge(KeyframeId first, KeyframeId second, const Sim3& first_from_second, double weight);
  // By keyframe id, of those that the map has now.
  std::vector<std::optional<Sim3>> NewFromOldWorld(const Map& map) const;

  double focal_px_;
  LoopOptions options_;
  PartId part_;
  PoseGraph graph_;
  std::vector<Sim3> old_from_world_;  // by node
  std::vector<uint32_t> node_of_;     // by keyframe id
  std::vector<double> shared_;        // by keyframe id, with the keyframe in hand: the certain landmarks
};

}  // namespace dynamic_slam
