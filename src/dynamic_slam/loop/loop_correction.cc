#include "dynamic_slam/loop/loop_correction.h"

#include <algorithm>
#include <limits>

#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// A landmark with a depth known to this part of it counts half, one with a less certain depth ever less. A
// pixel at the parallax of 10 degrees is about as much.
constexpr double kCertainDepth = 0.01;

// Keyframes that follow each other and share nothing keep their place to each other, if nothing speaks
// against it.
constexpr double kNoLandmarksWeight = 1e-3;

// What was verified outweighs all that was carried on to the keyframe from those before it.
constexpr double kLoopFactor = 10;

// On either side of a loop so many neighbours are tied to the other side as well: the newest keyframe alone
// may be held by less than what drifted is, and would be torn from its neighbours.
constexpr size_t kTiedNeighbours = 10;

double Certainty(const Landmark& landmark, const Keyframe& keyframe, double focal_px) {
  const double depth = (landmark.position() - keyframe.CenterInWorld()).norm();
  const double ratio = landmark.spread().norm() / (focal_px * kCertainDepth * depth);
  return 1 / (1 + ratio * ratio);
}

}  // namespace

LoopCorrection::LoopCorrection(const Camera& camera, const Map& map, const Loop& loop,
                               const LoopOptions& options,
                               const std::vector<std::pair<KeyframeId, KeyframeId>>& older_loops)
    : focal_px_(camera.fx),
      options_(options),
      part_(map.keyframes().At(loop.keyframe).part()),
      node_of_(map.keyframes().CreatedCount(), kNone) {
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != part_) return;
    node_of_[keyframe.id().value()] = static_cast<uint32_t>(graph_.nodes.size());
    old_from_world_.push_back(ToSim3(keyframe.cam_from_world()));
    graph_.nodes.push_back({old_from_world_.back(), map.IsOrigin(keyframe.id())});
  });
  KeyframeId previous;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != part_) return;
    AddKeyframe(map, keyframe, previous);
    previous = keyframe.id();
  });
  for (const auto& [first, second] : older_loops) {
    if (HasNode(first) && HasNode(second)) {
      AddEdge(first, second, FromKeyframe(map.keyframes().At(first), map.keyframes().At(second)),
              options_.min_inliers);
    }
  }
  AddLoop(map, loop);
}

// Ties it to the older ones.
void LoopCorrection::AddKeyframe(const Map& map, const Keyframe& keyframe, KeyframeId previous) {
  shared_.assign(node_of_.size(), kNoLandmarksWeight);
  keyframe.ForEachLandmark([&](uint32_t, LandmarkId id) {
    const Landmark& landmark = map.landmarks().At(id);
    const double certainty = Certainty(landmark, keyframe, focal_px_);
    for (const Observation& observation : landmark.observations()) {
      shared_[observation.keyframe.value()] += certainty;
    }
  });
  const auto tie = [&](KeyframeId other) {
    AddEdge(keyframe.id(), other, FromKeyframe(keyframe, map.keyframes().At(other)), shared_[other.value()]);
  };
  KeyframeId parent;
  for (const CovisibleKeyframe& other : keyframe.BestCovisible(keyframe.covisible().size())) {
    if (other.id < keyframe.id()) {
      parent = other.id;
      break;
    }
  }
  if (!parent.IsValid()) parent = previous;
  if (parent.IsValid()) tie(parent);
  for (const CovisibleKeyframe& other : keyframe.covisible()) {
    const bool is_older = other.id < keyframe.id() && other.id != parent;
    if (is_older && other.weight >= options_.min_edge_weight) tie(other.id);
  }
}

void LoopCorrection::AddLoop(const Map& map, const Loop& loop) {
  const Keyframe& keyframe = map.keyframes().At(loop.keyframe);
  const Keyframe& candidate = map.keyframes().At(loop.candidate);
  const uint32_t node = node_of_[loop.keyframe.value()];
  double weight = 0;
  for (const PoseGraph::Edge& edge : graph_.edges) {
    if (edge.first == node || edge.second == node) weight += kLoopFactor * edge.weight;
  }
  AddEdge(keyframe.id(), candidate.id(), loop.keyframe_from_candidate, weight);
  // Who sees as much of both sides lies between them.
  const auto for_neighbours = [&](const Keyframe& near, const Keyframe& opposite, const auto& tie) {
    for (const CovisibleKeyframe& entry : near.BestCovisible(kTiedNeighbours)) {
      const Keyframe& other = map.keyframes().At(entry.id);
      if (entry.id == opposite.id() || 2 * other.WeightOf(opposite.id()) > entry.weight) continue;
      tie(other);
    }
  };
  for_neighbours(keyframe, candidate, [&](const Keyframe& other) {
    AddEdge(other.id(), candidate.id(), FromKeyframe(other, keyframe) * loop.keyframe_from_candidate, weight);
  });
  for_neighbours(candidate, keyframe, [&](const Keyframe& other) {
    AddEdge(keyframe.id(), other.id(), loop.keyframe_from_candidate * FromKeyframe(candidate, other), weight);
  });
}

bool LoopCorrection::HasNode(KeyframeId keyframe) const {
  return keyframe.value() < node_of_.size() && node_of_[keyframe.value()] != kNone;
}

void LoopCorrection::AddEdge(KeyframeId first, KeyframeId second, const Sim3& first_from_second,
                             double weight) {
  graph_.edges.push_back({node_of_[first.value()], node_of_[second.value()], first_from_second, weight});
}

bool LoopCorrection::Solve(const std::function<bool()>& should_stop) {
  DS_TRACE("loop/pose graph");
  return OptimizePoseGraph(options_.pose_graph_iterations, should_stop, &graph_).usable;
}

std::vector<std::optional<Sim3>> LoopCorrection::NewFromOldWorld(const Map& map) const {
  std::vector<std::optional<Sim3>> new_from_old(map.keyframes().CreatedCount());
  std::optional<Sim3> latest;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    const uint32_t id = keyframe.id().value();
    if (keyframe.part() != part_) {
      new_from_old[id] = Sim3();
      return;
    }
    if (HasNode(keyframe.id())) {
      const uint32_t node = node_of_[id];
      new_from_old[id] = graph_.nodes[node].node_from_world.Inverse() * old_from_world_[node];
    } else {
      new_from_old[id] = latest;
      for (const CovisibleKeyframe& other : keyframe.BestCovisible(keyframe.covisible().size())) {
        if (!new_from_old[other.id.value()].has_value()) continue;
        new_from_old[id] = new_from_old[other.id.value()];
        break;
      }
    }
    latest = new_from_old[id];
  });
  return new_from_old;
}

void LoopCorrection::Apply(Map* map) const {
  DS_TRACE("loop/correct");
  map->BeginRevision();
  const std::vector<std::optional<Sim3>> new_from_old = NewFromOldWorld(*map);
  map->landmarks().ForEach([&](Landmark& landmark) {
    if (landmark.observations().empty()) return;
    const KeyframeId reference = landmark.IsSeenBy(landmark.created_by())
                                     ? landmark.created_by()
                                     : landmark.observations().front().keyframe;
    landmark.Transform(*new_from_old[reference.value()]);
  });
  map->keyframes().ForEach([&](Keyframe& keyframe) {
    const Sim3& moved = *new_from_old[keyframe.id().value()];
    keyframe.set_cam_from_world(ToRigid3(ToSim3(keyframe.cam_from_world()) * moved.Inverse()));
    keyframe.Rescale(moved.scale);
  });
}

}  // namespace dynamic_slam
