#include "dynamic_slam/report/truth_comparison.h"

#include <algorithm>

#include <fmt/core.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

TruthComparison CompareWithTruth(const Trajectory& truth, const Trajectory& estimate) {
  TruthComparison comparison;
  const MatchedPoses matched = MatchByTime(ToPoseList(truth), ToPoseList(estimate), kMaxTruthDifferenceS);
  comparison.ape = AbsolutePoseError(matched, Alignment::kSim3);
  comparison.path_m = PathLength(matched.reference);
  std::copy_if(truth.begin(), truth.end(), std::back_inserter(comparison.truth),
               [&estimate](const StampedPose& pose) {
                 return pose.timestamp_s >= estimate.front().timestamp_s - kMaxTruthDifferenceS &&
                        pose.timestamp_s <= estimate.back().timestamp_s + kMaxTruthDifferenceS;
               });
  return comparison;
}

std::string DescribeApe(const TruthComparison& comparison) {
  const double rmse = comparison.ape.translation_m.rmse;
  return fmt::format("rmse {:.4f} m ({:.2f}% of the path of {:.2f} m)", rmse, 100 * rmse / comparison.path_m,
                     comparison.path_m);
}

std::optional<std::string> DescribeLiveApe(const Trajectory& truth, const Trajectory& estimate,
                                           const Trajectory& live) {
  if (live.size() == estimate.size()) return std::nullopt;
  try {
    return fmt::format("{:.4f} m over the frames tracked live",
                       CompareWithTruth(truth, live).ape.translation_m.rmse);
  } catch (const InputError&) {  // too few
    return std::nullopt;
  }
}

TrajectoryPlot PlotOverTruth(const TruthComparison& comparison, const Trajectory& estimate) {
  TrajectoryPlot plot;
  plot.layers.push_back({.name = "truth",
                         .kind = PlotLayer::Kind::kLine,
                         .colour = kTruthColour,
                         .width_px = 5,
                         .positions = CameraPositions(comparison.truth)});
  plot.axes = LargestPlane(plot.layers.front().positions);
  plot.layers.push_back({.name = "estimated path",
                         .kind = PlotLayer::Kind::kLine,
                         .colour = kEstimateColour,
                         .width_px = 1.5,
                         .positions = CameraPositions(estimate, comparison.ape.reference_from_estimate)});
  return plot;
}

}  // namespace dynamic_slam
