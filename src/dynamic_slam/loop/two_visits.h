#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "dynamic_slam/loop/loop_closer.h"
#include "dynamic_slam/map/synthetic_world.h"

namespace dynamic_slam {

// The camera comes by twice and makes landmarks of its own each time, as if it did not know that it was here
// before.
struct TwoVisits {
  static constexpr int kPoints = 1500;
  static constexpr int kPasses = 6;  // keyframes each time that the camera comes by

  // The second visit begins at `x`, and is seen through the drift; in a part of the map of its own, or not.
  // Only some points look the same then. Of `more_points` nobody makes landmarks. Of the second visit's
  // keypoints those beyond a column of the image are on somebody who moves.
  explicit TwoVisits(const Sim3& drift, double second_x = 0.05, bool starts_anew = false,
                     size_t same_points = kPoints, int more_points = 0, float movers_from_px = 1e6)
      : world(kPoints + more_points), map(&world) {
    for (int visit = 0; visit < 2; ++visit) {
      if (visit == 1) world.Repaint(same_points);
      const PartId part = visit == 0 || starts_anew ? map.map.BeginPart() : PartId(0);
      for (int i = 0; i < kPasses; ++i) {
        const double x = 0.1 * i + (visit == 0 ? first_x : first_x + second_x);
        truth.push_back(SidewaysPose(x));
        ids[visit].push_back(map.Add(truth.back(), part, visit == 0 ? 1e6f : movers_from_px));
      }
      map.AddLandmarks(0, kPoints, ids[visit]);
    }
    map.Drift(ids[1], drift);
  }

  LoopResult Close(const LoopOptions& options = {}, const std::function<bool()>& should_stop = {}) {
    LoopCloser closer(world.camera(), options, 1, &map.shared_map);
    return closer.Process(ids[1].back(), map.map.epoch(), should_stop);
  }

  double WorstCenter() const {
    double worst = 0;
    for (size_t i = 0; i < truth.size(); ++i) {
      const Keyframe& keyframe = map.map.keyframes().At(KeyframeId(static_cast<uint32_t>(i)));
      worst = std::max(worst, (keyframe.CenterInWorld() - truth[i].TargetOriginInSource()).norm());
    }
    return worst;
  }

  // From its first keyframe to the others, in lengths of the map.
  std::vector<double> DistancesOfSecondVisit() const {
    const auto center = [&](int i) { return map.map.keyframes().At(ids[1][i]).CenterInWorld(); };
    std::vector<double> distances;
    for (int i = 1; i < kPasses; ++i) distances.push_back((center(i) - center(0)).norm());
    return distances;
  }

  double first_x = 0;
  SyntheticWorld world;
  SyntheticMap map;
  std::vector<Rigid3> truth;
  std::vector<KeyframeId> ids[2];
};

}  // namespace dynamic_slam
