#include "experiment.h"

#include <cmath>
#include <cstdint>
#include <set>
#include <utility>

#include <fmt/core.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/semantics/dynamic_prior.h"
#include "dynamic_slam/semantics/dynamic_score.h"

namespace dynamic_slam {
namespace {

constexpr double kMinTrueHeightPx = 30;

int64_t Microseconds(double stamp_s) { return std::llround(stamp_s * 1e6); }

std::vector<BoxRecord> MoversOf(std::vector<BoxRecord> records) {
  const DynamicPrior prior = LoadDynamicPrior("dynamic_prior");
  const double threshold = DynamicScoreOptions().threshold;
  std::erase_if(records,
                [&](const BoxRecord& record) { return prior.Score(record.class_name) <= threshold; });
  return records;
}

std::optional<TruthComparison> Compare(const std::string& source, const Trajectory& estimate) {
  const std::optional<Trajectory> truth = LoadGroundTruth(source);
  if (!truth.has_value() || estimate.empty()) return std::nullopt;
  try {
    return CompareWithTruth(*truth, estimate);
  } catch (const InputError&) {
    return std::nullopt;  // too few poses, or all in one place: nothing says how to align them
  }
}

void CompareRecall(const std::string& source, ExperimentRun* run) {
  std::vector<double> stamps_s;
  for (const RunSummary::FrameRecord& frame : run->summary.frames) stamps_s.push_back(frame.timestamp_s);
  const std::vector<BoxRecord> truth = TrueMovers(source, stamps_s);
  run->recall_before = CompareBoxes(truth, run->detected, {.class_name = ""});
  run->recall_after = CompareBoxes(truth, run->compensated, {.class_name = ""});
}

}  // namespace

ExperimentRun RunExperiment(const BenchArguments& arguments, const std::string& source, RunConsole* console,
                            const std::function<void(const RunProgress&)>& on_frame,
                            const std::function<void(const SlamSystem&, const RunSummary&)>& on_system) {
  ExperimentRun run;
  const BenchRun bench = RunForBench(arguments, source, {}, console, [&](const RunProgress& progress) {
    for (const DynamicBox& box : progress.result->objects.boxes) {
      run.compensated.push_back({progress.image->timestamp_s,
                                 progress.detector->class_names()[static_cast<size_t>(box.class_id)],
                                 box.score, 1, box.box});
    }
    if (on_frame) on_frame(progress);
  });
  run.summary = bench.summary;
  run.summary.source = source;
  run.trajectory = bench.system->FrameTrajectory();
  if (bench.detector != nullptr) {
    run.detected = MoversOf(bench.detector->records());
    run.compensated = MoversOf(std::move(run.compensated));
    CompareRecall(source, &run);
  }
  run.truth = Compare(source, run.trajectory);
  if (on_system) on_system(*bench.system, run.summary);
  return run;
}

BenchArguments WithoutSemantics(BenchArguments arguments) {
  arguments.detector = "none";
  return arguments;
}

std::vector<BoxRecord> TrueMovers(const std::filesystem::path& sequence, std::span<const double> stamps_s) {
  if (!std::filesystem::exists(sequence / "boxes.csv")) return {};
  std::set<int64_t> wanted;
  for (const double stamp_s : stamps_s) wanted.insert(Microseconds(stamp_s));
  std::vector<BoxRecord> movers = MoversOf(ReadBoxFile(sequence / "boxes.csv"));
  std::erase_if(movers,
                [&](const BoxRecord& record) { return !wanted.contains(Microseconds(record.timestamp_s)); });
  for (BoxRecord& record : movers) {
    if (record.box.height < kMinTrueHeightPx) record.visible = 0;
  }
  return movers;
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
