#include "experiment.h"

#include <utility>

#include <fmt/core.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

std::optional<TruthComparison> Compare(const std::optional<Trajectory>& truth, const Trajectory& estimate) {
  if (!truth.has_value() || estimate.empty()) return std::nullopt;
  try {
    return CompareWithTruth(*truth, estimate);
  } catch (const InputError&) {
    return std::nullopt;  // too few poses, or all in one place: nothing says how to align them
  }
}

}  // namespace

ExperimentRun RunExperiment(const BenchArguments& arguments, const std::string& source, RunConsole* console,
                            const std::function<void(const RunProgress&)>& on_frame,
                            const std::function<void(const SlamSystem&, const ExperimentRun&)>& on_system) {
  ExperimentRun run;
  const BenchRun bench = RunForBench(arguments, source, {}, console, on_frame);
  run.summary = bench.summary;
  run.trajectory = bench.system->FrameTrajectory();
  run.record = bench.record;
  const DetectionMetricsOptions any{.class_name = ""};
  run.recall_before = CompareBoxes(run.record.true_boxes, run.record.detected, any);
  run.recall_after = CompareBoxes(run.record.true_boxes, run.record.compensated, any);
  run.truth = Compare(run.record.truth, run.trajectory);
  if (on_system) on_system(*bench.system, run);
  return run;
}

BenchArguments WithoutSemantics(BenchArguments arguments) {
  arguments.detector = "none";
  return arguments;
}

nlohmann::ordered_json OrNull(const std::optional<double>& value) {
  if (!value.has_value()) return nullptr;
  return *value;
}

std::string Percent(const std::optional<double>& share, int digits) {
  return share.has_value() ? fmt::format("{:.{}f}%", 100 * *share, digits) : "-";
}

TrajectoryPlot PlotBoth(const Trajectory& truth, const ExperimentRun& with, const ExperimentRun& without) {
  TrajectoryPlot plot;
  const auto add = [&plot](const std::string& name, const cv::Scalar& colour, double width_px,
                           std::vector<Eigen::Vector3d> positions) {
    plot.layers.push_back({.name = name,
                           .kind = PlotLayer::Kind::kLine,
                           .colour = colour,
                           .width_px = width_px,
                           .positions = std::move(positions)});
  };
  const auto add_run = [&add](const std::string& name, const cv::Scalar& colour, const ExperimentRun& run) {
    if (!run.truth.has_value()) return;
    add(name, colour, 1.5, CameraPositions(run.trajectory, run.truth->ape.reference_from_estimate));
  };
  add("truth", kTruthColour, 5, CameraPositions(truth));
  add_run("without semantics", kWithoutColour, without);
  add_run("with", kEstimateColour, with);
  plot.axes = LargestPlane(plot.layers.front().positions);
  return plot;
}

}  // namespace dynamic_slam
