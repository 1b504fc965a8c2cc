#pragma once

#include <optional>
#include <string>

#include "dynamic_slam/eval/metrics.h"
#include "dynamic_slam/eval/trajectory_plot.h"
#include "dynamic_slam/geometry/trajectory.h"

namespace dynamic_slam {

// Between the stamps of matched poses, s; as evo's default.
inline constexpr double kMaxTruthDifferenceS = 0.01;

// An estimated trajectory beside the true one.
struct TruthComparison {
  TrajectoryErrors ape;  // after sim(3) alignment
  double path_m = 0;     // length of the matched part of the truth
  Trajectory truth;      // from the first to the last estimated frame
};

// Throws InputError when too few poses match, or all lie on one line.
TruthComparison CompareWithTruth(const Trajectory& truth, const Trajectory& estimate);

// "rmse 0.0123 m (0.45% of the path of 2.7 m)".
std::string DescribeApe(const TruthComparison& comparison);

// The same of the frames that were tracked when their turn came, where others were given a pose later:
// "0.0111 m over the frames tracked live". Nothing where there are none, or too few.
std::optional<std::string> DescribeLiveApe(const Trajectory& truth, const Trajectory& estimate,
                                           const Trajectory& live);

// The truth and, moved onto it, the estimate.
TrajectoryPlot PlotOverTruth(const TruthComparison& comparison, const Trajectory& estimate);

}  // namespace dynamic_slam
