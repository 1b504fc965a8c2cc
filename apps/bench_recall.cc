#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
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
  int seeds = 3;
};

struct RecallOfFrame {
  double timestamp_s = 0;
  DetectionMetrics before, after;
};

struct RecallOfSequence {
  std::string name;
  std::vector<RecallOfFrame> frames;
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
  fmt::print("{:<28} {:>10} {:>14} {:>14}\n", name, fmt::format("{} of {}", m.frames_hit, m.frames),
             fmt::format("{:.3f}", m.FrameRecall()), fmt::format("{:.3f}", m.Recall()));
}

nlohmann::ordered_json RowsOf(const RecallOfSequence& sequence) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const RecallOfFrame& frame : sequence.frames) {
    rows.push_back({{"sequence", sequence.name},
                    {"timestamp", frame.timestamp_s},
                    {"true_boxes", frame.before.hits + frame.before.misses},
                    {"found_before", frame.before.hits},
                    {"found_after", frame.after.hits},
                    {"wrong_before", frame.before.false_alarms},
                    {"wrong_after", frame.after.false_alarms}});
  }
  return rows;
}

// Of the folder that was named, or of rendered scenes; those until an interrupt.
std::vector<RecallOfSequence> RunSequences(const RecallArguments& arguments, RunConsole* console) {
  const auto run = [&](const std::string& name, const std::string& folder) {
    const ExperimentRun done = RunExperiment(arguments, folder, console);
    return RecallOfSequence{name, RecallByFrame(done), done.recall_before, done.recall_after};
  };
  if (std::filesystem::is_directory(arguments.source)) return {run(arguments.source, arguments.source)};
  SceneOptions scene = LoadScene(arguments.source.empty() ? "office" : arguments.source);
  if (arguments.source.empty()) {  // as walking_rpy
    scene.camera.motion = "rpy";
    scene.frames = kPaperFrames;
  }
  if (const int frames = arguments.source_options.max_frames; frames > 0) scene.frames = frames;
  const std::string folder = (std::filesystem::path(arguments.out) / "sequence").string();
  std::vector<RecallOfSequence> sequences;
  for (int i = 0; i < arguments.seeds && !console->ShouldStop(); ++i, ++scene.seed) {
    RenderScene(scene, folder);
    sequences.push_back(run(fmt::format("seed {}", scene.seed), folder));
  }
  return sequences;
}

void RunRecall(const RecallArguments& arguments, int* exit_code) {
  const std::filesystem::path out = arguments.out;
  PrepareOutputFolder(out);
  RunConsole console(arguments.quiet);
  const std::vector<RecallOfSequence> sequences = RunSequences(arguments, &console);
  if (console.ShouldStop()) {
    *exit_code = kExitInterrupted;
    return;
  }
  DetectionMetrics all_before, all_after;
  nlohmann::ordered_json rows = nlohmann::ordered_json::array(), parts = nlohmann::ordered_json::array();
  for (const RecallOfSequence& sequence : sequences) {
    all_before += sequence.before;
    all_after += sequence.after;
    for (nlohmann::ordered_json& row : RowsOf(sequence)) rows.push_back(std::move(row));
    parts.push_back({{"sequence", sequence.name},
                     {"before", ToJson(sequence.before)},
                     {"after", ToJson(sequence.after)}});
  }
  if (all_before.frames == 0) {
    throw InputError(sequences.front().name, "has no true box of a person or car in these images",
                     "Give a scene, or a folder with boxes.csv as `simulate` writes it.");
  }
  const auto share = [](int part) { return static_cast<double>(part) / kPaperFrames; };
  WriteCsv(out / "recall.csv", rows);
  WriteJson(out / "recall.json", {{"detector", arguments.detector},
                                  {"before", ToJson(all_before)},
                                  {"after", ToJson(all_after)},
                                  {"sequences", parts},
                                  {"paper",
                                   {{"sequence", "walking_rpy"},
                                    {"recall_per_frame_before", share(kPaperFoundBefore)},
                                    {"recall_per_frame_after", share(kPaperFoundAfter)}}}});
  std::string title =
      fmt::format("Recall per frame: {:.1f}% before, {:.1f}% after compensation (the paper: 82.3%, 99.8%)",
                  100 * all_before.FrameRecall(), 100 * all_after.FrameRecall());
  std::vector<std::pair<std::string, DetectionMetrics>> table;
  if (sequences.size() > 1) {
    title += fmt::format("; of {} scenes this is {}", sequences.size(), sequences.front().name);
    for (const RecallOfSequence& sequence : sequences) {
      table.emplace_back(sequence.name + ", detector", sequence.before);
      table.emplace_back(sequence.name + ", compensated", sequence.after);
    }
  }
  table.emplace_back("detector", all_before);
  table.emplace_back("after compensation", all_after);
  const CurvePlot plot = PlotRecall(title, sequences.front().frames);
  WritePicture((out / "recall.png").string(), DrawCurves(plot, 1100, 340));
  nlohmann::ordered_json results = nlohmann::ordered_json::array();
  fmt::print("\n{:<28} {:>10} {:>14} {:>14}\n", "", "frames", "recall/frame", "recall/box");
  for (const auto& [boxes, metrics] : table) {
    nlohmann::ordered_json row = {{"boxes", boxes}};
    row.update(ToJson(metrics));
    results.push_back(std::move(row));
    PrintRow(boxes, metrics);
  }
  WriteBenchReport(out, "Recall of the detector", arguments, results, {plot});
  fmt::print("{:<28} {:>10} {:>14.3f}\n", "paper, SSD",
             fmt::format("{} of {}", kPaperFoundBefore, kPaperFrames), share(kPaperFoundBefore));
  fmt::print("{:<28} {:>10} {:>14.3f}\n", "paper, compensated",
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
  command->add_option("--seeds", a.seeds, "Scenes")->check(CLI::Range(1, 1000))->capture_default_str();
  command->add_option("--camera", a.camera, "As of run");
  a.detector = "builtin";
  a.out = "out/bench_recall";
  AddRunOptions(command, "recall.csv, .json and .png (first scene)", &a);
  AddSourceOptions(command, &a.source_options);
  command->footer(
      "Per frame, as the paper counts: at least one object was found, of the frames that show one.\n"
      "Per box: IoU of 0.5, one to one; boxes that are less than half visible or lower than 30 px do not "
      "count.");
  command->callback([arguments, exit_code] { RunRecall(*arguments, exit_code); });
}

}  // namespace dynamic_slam
