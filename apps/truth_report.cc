#include "truth_report.h"

#include <algorithm>

#include <fmt/core.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/trajectory_file.h"

namespace dynamic_slam {
namespace {

constexpr double kMaxDifferenceS = 0.01;  // between the stamps of matched poses
constexpr int kPictureWidthPx = 900, kPictureHeightPx = 700;

}  // namespace

TruthComparison CompareWithTruth(const Trajectory& truth, const Trajectory& estimate) {
  TruthComparison comparison;
  const MatchedPoses matched = MatchByTime(ToPoseList(truth), ToPoseList(estimate), kMaxDifferenceS);
  comparison.ape = AbsolutePoseError(matched, Alignment::kSim3);
  comparison.path_m = PathLength(matched.reference);
  std::copy_if(truth.begin(), truth.end(), std::back_inserter(comparison.truth),
               [&estimate](const StampedPose& pose) {
                 return pose.timestamp_s >= estimate.front().timestamp_s - kMaxDifferenceS &&
                        pose.timestamp_s <= estimate.back().timestamp_s + kMaxDifferenceS;
               });
  return comparison;
}

std::string DescribeApe(const TruthComparison& comparison) {
  const double rmse = comparison.ape.translation_m.rmse;
  return fmt::format("rmse {:.4f} m ({:.2f}% of the path of {:.2f} m)", rmse, 100 * rmse / comparison.path_m,
                     comparison.path_m);
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

std::optional<TruthComparison> ReportTruth(const std::filesystem::path& source, const Trajectory& estimate,
                                           const std::filesystem::path& out) {
  // Ground truth is a bonus: with a broken one, or without an overlap, the run is as good.
  try {
    const std::optional<Trajectory> truth = LoadGroundTruth(source);
    if (!truth.has_value() || estimate.empty()) return std::nullopt;
    const TruthComparison comparison = CompareWithTruth(*truth, estimate);
    fmt::print("APE against the ground truth, after sim(3) alignment: {}\n", DescribeApe(comparison));
    TrajectoryPlot plot = PlotOverTruth(comparison, estimate);
    plot.title = fmt::format("{}: APE {}", out.filename().string(), DescribeApe(comparison));
    WritePicture((out / "trajectory.png").string(), DrawPlot(plot, kPictureWidthPx, kPictureHeightPx));
    return comparison;
  } catch (const InputError& error) {
    fmt::print("no APE: {}\n", error.what());
    return std::nullopt;
  }
}

}  // namespace dynamic_slam
