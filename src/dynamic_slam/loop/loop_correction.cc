#include "dynamic_slam/loop/loop_correction.h"

#include <algorithm>
#include <limits>

#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// Keyframes that follow each other and share nothing keep their place to each other, if nothing speaks
// against it.
constexpr double kNoLandmarksWeight = 1;

// What was verified outweighs what was carried on from keyframe to keyframe.
constexpr double kLoopFactor = 10;

}  // namespace

LoopCorrection::LoopCorrection(const Map& map, const Loop& loop, const LoopOptions& options,
                               const std::vector<std::pair<KeyframeId, KeyframeId>>& older_loops)
    : options_(options),
      part_(map.keyframes().At(loop.keyframe).part()),
      node_of_(map.keyframes().CreatedCount(), kNone) {
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != part_) return;
    node_of_[keyframe.id().value()] = static_cast<uint32_t>(graph_.nodes.size());
    old_from_world_.push_back(ToSim3(keyframe.cam_from_world()));
    graph_.nodes.push_back({old_from_world_.back(), map.IsOrigin(keyframe.id())});
  });
  const auto now = [&](KeyframeId first, KeyframeId second) {
    return ToSim3(map.keyframes().At(first).cam_from_world() *
                  map.keyframes().At(second).cam_from_world().Inverse());
  };
  KeyframeId previous;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != part_) return;
    CovisibleKeyframe parent;
    for (const CovisibleKeyframe& other : keyframe.BestCovisible(keyframe.covisible().size())) {
      if (other.id < keyframe.id()) {
        parent = other;
        break;
      }
    }
    if (parent.id.IsValid()) {
      AddEdge(keyframe.id(), parent.id, now(keyframe.id(), parent.id), parent.weight);
    } else if (previous.IsValid()) {
      AddEdge(keyframe.id(), previous, now(keyframe.id(), previous), kNoLandmarksWeight);
    }
    for (const CovisibleKeyframe& other : keyframe.covisible()) {
      if (keyframe.id() < other.id || other.id == parent.id || other.weight < options_.min_edge_weight)
        continue;
      AddEdge(keyframe.id(), other.id, now(keyframe.id(), other.id), other.weight);
    }
    previous = keyframe.id();
  });
  for (const auto& [first, second] : older_loops) {
    if (HasNode(first) && HasNode(second)) {
      AddEdge(first, second, now(first, second), options_.min_inliers);
    }
  }
  AddEdge(loop.keyframe, loop.candidate, loop.keyframe_from_candidate,
          kLoopFactor * static_cast<double>(loop.links.size()));
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
