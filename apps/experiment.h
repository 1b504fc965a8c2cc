#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "bench_run.h"
#include "dynamic_slam/eval/detection_metrics.h"
#include "dynamic_slam/eval/trajectory_plot.h"
#include "dynamic_slam/system/sequence_runner.h"
#include "run_console.h"
#include "truth_report.h"

namespace dynamic_slam {

// Of the lines of a run without the semantic part, in pictures.
inline const cv::Scalar kWithoutColour(60, 60, 215);  // red, BGR

// What came of a run over a sequence whose truth is known, of `demo` or `bench`.
struct ExperimentRun {
  RunSummary summary;
  Trajectory trajectory;                         // of the main part of the map
  std::optional<TruthComparison> truth;          // none without truth, or where the camera went nowhere
  RunRecord record;                              // truth, boxes and frames
  DetectionMetrics recall_before, recall_after;  // by the true boxes; of nothing without truth

  double Coverage() const { return summary.Coverage(); }  // live
  std::optional<double> ErrorShare() const {              // APE (rmse) over the path
    if (!truth.has_value()) return std::nullopt;
    return truth->ape.translation_m.rmse / truth->path_m;
  }
};

// Runs the SLAM offline over a sequence; `on_system` may be empty, and is called when the run has ended.
// Throws InputError for what is wrong with the sequence or the options.
ExperimentRun RunExperiment(
    const BenchArguments& arguments, const std::string& source, RunConsole* console,
    const std::function<void(const RunProgress&)>& on_frame = {},
    const std::function<void(const SlamSystem&, const ExperimentRun&)>& on_system = {});

// The same arguments without the semantic part.
BenchArguments WithoutSemantics(BenchArguments arguments);

// The number, or null.
nlohmann::ordered_json OrNull(const std::optional<double>& value);

// "0.42%", or "-" without a value.
std::string Percent(const std::optional<double>& share, int digits = 2);

// The truth and both paths, each moved onto it; either run may be without a path.
TrajectoryPlot PlotBoth(const Trajectory& truth, const ExperimentRun& with, const ExperimentRun& without);

}  // namespace dynamic_slam
