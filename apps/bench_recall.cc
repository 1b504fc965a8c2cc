#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "cmd_bench.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/sim/simulation.h"
#include "experiment.h"
#include "render_sequence.h"
#include "run_console.h"
#include "source_arguments.h"

namespace dynamic_slam {
namespace {

// Section 4.1: on TUM's walking_rpy, frames in which an object was found.
constexpr int kPaperFrames = 487, kPaperFoundBefore = 401, kPaperFoundAfter = 486;

struct RecallArguments : BenchArguments {
  std::string source;
};

struct RecallOfFrame {
  double timestamp_s = 0;
  DetectionMetrics before, after;
};

std::vector<RecallOfFrame> RecallByFrame(const ExperimentRun& run) {
  const auto by_stamp = [](const std::vector<BoxRecord>& records) {
    std::map<int64_t, std::vector<BoxRecord>> sorted;
    for (const BoxRecord& record : records) {
      sorted[std::llround(1e6 * record.timestamp_s)].push_back(record);
    }
    return sorted;
  };
  auto truth = by_stamp(run.record.true_boxes), detected = by_stamp(run.record.detected),
       compensated = by_stamp(run.record.compensated);
  std::vector<RecallOfFrame> frames;
  for (const RunSummary::FrameRecord& frame : run.summary.frames) {
    const int64_t key = std::llround(1e6 * frame.timestamp_s);
    frames.push_back({frame.timestamp_s, CompareFrame(truth[key], detected[key], {.class_name = ""}),
                      CompareFrame(truth[key], compensated[key], {.class_name = ""})});
  }
  return frames;
}

nlohmann::ordered_json ToJson(const DetectionMetrics& metrics) {
  return {{"frames", metrics.frames},
          {"frames_with_one_found", metrics.frames_hit},
          {"recall_per_frame", metrics.FrameRecall()},
          {"frames_with_all_found", metrics.frames_complete},
          {"true_boxes", metrics.hits + metrics.misses},
          {"recall_per_box", metrics.Recall()},
          {"miss_rate_per_box", metrics.MissRate()},
          {"precision", metrics.Precision()}};
}

// How many boxes each frame has, and how many of them were found.
CurvePlot PlotRecall(const std::string& title, const std::vector<RecallOfFrame>& frames) {
  CurvePlot plot{title, "time [s]", "boxes", {}};
  CurvePlot::Curve all{"true boxes", kTruthColour, {}, 5},
      before{"found by the detector", kWithoutColour, {}, 1.2},
      after{"after compensation", kEstimateColour, {}, 1.8};
  for (const RecallOfFrame& frame : frames) {
    const auto add = [&frame](CurvePlot::Curve& curve, size_t count) {
      curve.points.emplace_back(frame.timestamp_s, static_cast<double>(count));
    };
    add(all, frame.before.hits + frame.before.misses);
    add(before, frame.before.hits);
    add(after, frame.after.hits);
  }
  plot.curves = {all, before, after};
  return plot;
}

void PrintRow(const std::string& name, const DetectionMetrics& m) {
  fmt::print("{:<24} {:>10} {:>14} {:>14}\n", name, fmt::format("{} of {}", m.frames_hit, m.frames),
             fmt::format("{:.3f}", m.FrameRecall()), fmt::format("{:.3f}", m.Recall()));
}

void RunRecall(const RecallArguments& arguments, int* exit_code) {
  const std::filesystem::path out = arguments.out;
  PrepareOutputFolder(out);
  std::string sequence = arguments.source;
  if (!std::filesystem::is_directory(sequence)) {
    SceneOptions scene = LoadScene(sequence.empty() ? "office" : sequence);
    if (sequence.empty()) {  // as walking_rpy
      scene.camera.motion = "rpy";
      scene.frames = kPaperFrames;
    }
    if (const int frames = arguments.source_options.max_frames; frames > 0) scene.frames = frames;
    sequence = (out / "sequence").string();
    RenderScene(scene, sequence);
  }
  RunConsole console(arguments.quiet);
  const ExperimentRun run = RunExperiment(arguments, sequence, &console);
  if (console.ShouldStop()) {
    *exit_code = kExitInterrupted;
    return;
  }
  if (run.recall_before.frames == 0) {
    throw InputError(sequence, "has no true box of a person or car in these images",
                     "Give a scene, or a folder with boxes.csv as `simulate` writes it.");
  }
  const std::vector<RecallOfFrame> frames = RecallByFrame(run);
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const RecallOfFrame& frame : frames) {
    rows.push_back({{"timestamp", frame.timestamp_s},
                    {"true_boxes", frame.before.hits + frame.before.misses},
                    {"found_before", frame.before.hits},
                    {"found_after", frame.after.hits},
                    {"wrong_before", frame.before.false_alarms},
                    {"wrong_after", frame.after.false_alarms}});
  }
  const auto share = [](int part) { return static_cast<double>(part) / kPaperFrames; };
  WriteCsv(out / "recall.csv", rows);
  WriteJson(out / "recall.json", {{"sequence", sequence},
                                  {"detector", arguments.detector},
                                  {"before", ToJson(run.recall_before)},
                                  {"after", ToJson(run.recall_after)},
                                  {"paper",
                                   {{"sequence", "walking_rpy"},
                                    {"recall_per_frame_before", share(kPaperFoundBefore)},
                                    {"recall_per_frame_after", share(kPaperFoundAfter)}}}});
  const std::string title =
      fmt::format("Recall per frame: {:.1f}% before, {:.1f}% after compensation (the paper: 82.3%, 99.8%)",
                  100 * run.recall_before.FrameRecall(), 100 * run.recall_after.FrameRecall());
  const CurvePlot plot = PlotRecall(title, frames);
  WritePicture((out / "recall.png").string(), DrawCurves(plot, 1100, 340));
  nlohmann::ordered_json before = {{"boxes", "of the detector"}}, after = {{"boxes", "after compensation"}};
  before.update(ToJson(run.recall_before));
  after.update(ToJson(run.recall_after));
  WriteBenchReport(out, "Recall of the detector", arguments, {before, after}, {plot});
  fmt::print("\n{:<24} {:>10} {:>14} {:>14}\n", "", "frames", "recall/frame", "recall/box");
  PrintRow("detector", run.recall_before);
  PrintRow("after compensation", run.recall_after);
  fmt::print("{:<24} {:>10} {:>14.3f}\n", "paper, SSD",
             fmt::format("{} of {}", kPaperFoundBefore, kPaperFrames), share(kPaperFoundBefore));
  fmt::print("{:<24} {:>10} {:>14.3f}\n", "paper, compensated",
             fmt::format("{} of {}", kPaperFoundAfter, kPaperFrames), share(kPaperFoundAfter));
  fmt::print("results: {}\n", arguments.out);
}

}  // namespace

void AddRecallCommand(CLI::App* bench, int* exit_code) {
  CLI::App* command = bench->add_subcommand(
      "recall", "How many people and cars the detector finds, before and after compensation (paper 4.1)");
  const auto arguments = std::make_shared<RecallArguments>();
  RecallArguments& a = *arguments;
  command->add_option("SOURCE", a.source,
                      "A scene, or a folder with images and boxes.csv; default: an office with motion rpy");
  command->add_option("--camera", a.camera, "As of run");
  a.detector = "builtin";
  a.out = "out/bench_recall";
  AddRunOptions(command, "recall.csv, .json and .png", &a);
  AddSourceOptions(command, &a.source_options);
  command->footer(
      "Per frame, as the paper counts: at least one object was found, of the frames that show one.\n"
      "Per box: IoU of 0.5, one to one; boxes that are less than half visible or lower than 30 px do not "
      "count.");
  command->callback([arguments, exit_code] { RunRecall(*arguments, exit_code); });
}

}  // namespace dynamic_slam
