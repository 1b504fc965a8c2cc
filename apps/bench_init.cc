#include <algorithm>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "cmd_bench.h"
#include "dynamic_slam/sim/simulation.h"
#include "experiment.h"
#include "render_sequence.h"
#include "run_console.h"

namespace dynamic_slam {
namespace {

// Section 4.3: good starts of ORB-SLAM2 and of Dynamic-SLAM.
constexpr int kPaperRepetitions = 20, kPaperWithout = 15, kPaperWith = 19;

// Of the path; a start that errs by more is wrong.
constexpr double kMaxErrorShare = 0.05;

struct InitArguments : BenchArguments {
  std::string scene = "approach";
  int repetitions = kPaperRepetitions, fixed_repetitions = 5;
  int frames = 0;  // 0: the scene's
};

struct Start {
  bool fixed = false, semantics = false;
  uint64_t seed = 0;
  double end_s = 0;                 // of the sequence
  std::optional<double> started_s;  // the first pose
  bool tracks_at_end = false;
  std::optional<double> error_share;  // APE over the path

  // With a fixed camera any pose is false: nothing can be triangulated. Else the start is good when tracking
  // goes on from it to the end, along the true path.
  bool IsGood() const {
    if (fixed) return !started_s.has_value();
    return tracks_at_end && error_share.has_value() && *error_share <= kMaxErrorShare;
  }
};

Start RunOnce(const BenchArguments& arguments, const std::string& sequence, RunConsole* console) {
  const ExperimentRun run = RunExperiment(arguments, sequence, console);
  Start start;
  start.error_share = run.ErrorShare();
  for (const RunSummary::FrameRecord& frame : run.summary.frames) {
    start.tracks_at_end = frame.state == TrackingState::kTracking;
    if (start.tracks_at_end && !start.started_s) start.started_s = frame.timestamp_s;
    start.end_s = frame.timestamp_s;
  }
  return start;
}

int CountGood(const std::vector<Start>& starts, bool fixed, bool semantics) {
  return static_cast<int>(std::count_if(starts.begin(), starts.end(), [=](const Start& start) {
    return start.fixed == fixed && start.semantics == semantics && start.IsGood();
  }));
}

// A line for each repetition, from the start to the end of the sequence; a short one where there was no
// start.
CurvePlot PlotStarts(const std::vector<Start>& starts, bool fixed, bool semantics) {
  CurvePlot plot{"", "time [s]", "repetition", {}};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CurvePlot::Curve good{"good start", kEstimateColour, {}, 3}, bad{"false start", kWithoutColour, {}, 3},
      none{"no start", kFaintInk, {}, 3};
  int repetition = 0;
  for (const Start& start : starts) {
    if (start.fixed != fixed || start.semantics != semantics) continue;
    const double y = ++repetition;
    CurvePlot::Curve& curve = !start.started_s ? none : start.IsGood() ? good : bad;
    curve.points.insert(curve.points.end(),
                        {{start.started_s.value_or(0.97 * start.end_s), y}, {start.end_s, y}, {nan, nan}});
    plot.x_max = 1.02 * start.end_s;
  }
  plot.y_max = repetition + 1;
  plot.title = fmt::format("{} camera, {} semantics: {} of {} good", fixed ? "Fixed" : "Swaying",
                           semantics ? "with" : "without", CountGood(starts, fixed, semantics), repetition);
  plot.curves = {good, bad, none};
  return plot;
}

cv::Mat DrawStarts(const std::vector<Start>& starts) {
  constexpr double kWidthPx = 560, kHeightPx = 380, kFixedHeightPx = 240;
  Canvas canvas(static_cast<int>(2 * kWidthPx), static_cast<int>(kHeightPx + kFixedHeightPx));
  for (const bool semantics : {true, false}) {
    const double left = semantics ? 0 : kWidthPx;
    DrawCurves(PlotStarts(starts, false, semantics), {left, 0}, kWidthPx, kHeightPx, &canvas);
    DrawCurves(PlotStarts(starts, true, semantics), {left, kHeightPx}, kWidthPx, kFixedHeightPx, &canvas);
  }
  return canvas.Finish();
}

nlohmann::ordered_json Row(const Start& start) {
  return {{"camera", start.fixed ? "fixed" : "swaying"},
          {"seed", start.seed},
          {"semantics", start.semantics},
          {"started_s", OrNull(start.started_s)},
          {"tracks_at_end", start.tracks_at_end},
          {"ape_share", OrNull(start.error_share)},
          {"good", start.IsGood()}};
}

// With semantics and without.
std::vector<Start> RunScene(const InitArguments& arguments, SceneOptions scene, uint64_t seed, bool fixed,
                            RunConsole* console) {
  scene.seed = seed;
  if (fixed) {
    scene.camera.motion = "static";
    scene.camera.amplitude = 0;
  }
  const std::string sequence = (std::filesystem::path(arguments.out) / "sequence").string();
  RenderScene(scene, sequence);
  std::vector<Start> starts;
  for (const BenchArguments& run : {BenchArguments(arguments), WithoutSemantics(arguments)}) {
    Start start = RunOnce(run, sequence, console);
    start.fixed = fixed;
    start.semantics = starts.empty();
    start.seed = seed;
    starts.push_back(start);
  }
  return starts;
}

void RunInit(const InitArguments& arguments, int* exit_code) {
  const std::filesystem::path out = arguments.out;
  PrepareOutputFolder(out);
  RunConsole console(arguments.quiet);
  SceneOptions scene = LoadScene(arguments.scene);
  if (arguments.frames > 0) scene.frames = arguments.frames;
  std::vector<Start> starts;
  for (const bool fixed : {true, false}) {
    const int repetitions = fixed ? arguments.fixed_repetitions : arguments.repetitions;
    for (int i = 0; i < repetitions; ++i) {
      const std::vector<Start> both =
          RunScene(arguments, scene, scene.seed + static_cast<uint64_t>(i), fixed, &console);
      if (console.ShouldStop()) {
        *exit_code = kExitInterrupted;
        return;
      }
      starts.insert(starts.end(), both.begin(), both.end());
    }
  }
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const Start& start : starts) rows.push_back(Row(start));
  const auto counts = [&starts](bool semantics) {
    return nlohmann::ordered_json{{"good_starts", CountGood(starts, false, semantics)},
                                  {"fixed_without_false_start", CountGood(starts, true, semantics)}};
  };
  WriteCsv(out / "init.csv", rows);
  WriteJson(out / "init.json", {{"detector", arguments.detector},
                                {"repetitions", arguments.repetitions},
                                {"fixed_repetitions", arguments.fixed_repetitions},
                                {"with", counts(true)},
                                {"without", counts(false)},
                                {"paper",
                                 {{"repetitions", kPaperRepetitions},
                                  {"with", {{"good_starts", kPaperWith}}},
                                  {"without", {{"good_starts", kPaperWithout}}}}},
                                {"starts", rows}});
  WritePicture((out / "init.png").string(), DrawStarts(starts));
  std::vector<CurvePlot> plots;
  for (const bool fixed : {false, true}) {
    for (const bool semantics : {true, false}) plots.push_back(PlotStarts(starts, fixed, semantics));
  }
  WriteBenchReport(out, "Starts before somebody who moves", arguments, rows, plots);
  fmt::print("\n{:<24}{:>26}{:>28}\n", "", "good starts, camera sways", "no false start, it is fixed");
  for (const bool semantics : {true, false}) {
    fmt::print("{:<24}{:>26}{:>28}\n", semantics ? "with semantics" : "without",
               fmt::format("{} of {}", CountGood(starts, false, semantics), arguments.repetitions),
               fmt::format("{} of {}", CountGood(starts, true, semantics), arguments.fixed_repetitions));
  }
  fmt::print("{:<24}{:>26}\n{:<24}{:>26}\nresults: {}\n", "paper, Dynamic-SLAM",
             fmt::format("{} of {}", kPaperWith, kPaperRepetitions), "paper, ORB-SLAM2",
             fmt::format("{} of {}", kPaperWithout, kPaperRepetitions), arguments.out);
}

}  // namespace

void AddInitCommand(CLI::App* bench, int* exit_code) {
  CLI::App* command =
      bench->add_subcommand("init", "Starts while somebody moves before the camera (paper 4.3)");
  const auto arguments = std::make_shared<InitArguments>();
  InitArguments& a = *arguments;
  command->add_option("--scene", a.scene, "A scene whose camera sways")->capture_default_str();
  command->add_option("--repetitions", a.repetitions, "Scenes in which the camera sways")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_option("--fixed", a.fixed_repetitions, "Scenes in which it is fixed")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_option("--frames", a.frames, "Frames of each; default: the scene's")
      ->check(CLI::Range(1, 1000000));
  a.detector = "builtin";
  a.out = "out/bench_init";
  AddRunOptions(command, "init.csv, .json and .png", &a);
  command->footer(
      "A start is good when tracking goes on from it to the end and errs by 5% of the path at most. A fixed\n"
      "camera must not start: any pose is a false start. sequence/ in the results holds the last images.");
  command->callback([arguments, exit_code] { RunInit(*arguments, exit_code); });
}

}  // namespace dynamic_slam
