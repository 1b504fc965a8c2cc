#include "cmd_demo.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "demo_picture.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/report/path_section.h"
#include "dynamic_slam/report/report_page.h"
#include "dynamic_slam/report/table.h"
#include "dynamic_slam/sim/simulation.h"
#include "experiment.h"
#include "render_sequence.h"
#include "run_console.h"

namespace dynamic_slam {
namespace {

constexpr const char* kDefaultOut = "out/demo";
// As TUM's walking_xyz: two people walk before the camera, which sways along all axes. And a block by car.
constexpr const char* kScenes[] = {"office_walk", "street_short"};

struct DemoArguments : BenchArguments {
  std::optional<uint64_t> seed;
  std::optional<int> frames;
  bool force = false;
};

DemoScene RunScene(const DemoArguments& arguments, const std::string& name, RunConsole* console) {
  const std::filesystem::path out = std::filesystem::path(arguments.out) / name, sequence = out / "sequence";
  // The default folder is the demo's own.
  if (!arguments.force && arguments.out != kDefaultOut) CheckHoldsNoSequence(sequence);
  SceneOptions options = LoadScene(name);
  options.seed = arguments.seed.value_or(options.seed);
  options.frames = std::min(options.frames, arguments.frames.value_or(options.frames));
  RenderScene(options, sequence);
  DemoScene scene;
  scene.name = name;
  scene.truth = LoadGroundTruth(sequence).value_or(Trajectory());
  const auto write_to = [&name](const std::filesystem::path& folder, const std::string& what) {
    return [=](const SlamSystem& system, const ExperimentRun& run) {
      WriteResults(folder, system, run.summary);
      WriteRunReport(folder, fmt::format("{}, {}", name, what), system, run.summary, run.record);
    };
  };
  scene.with =
      RunExperiment(arguments, sequence.string(), console, {}, write_to(out / "with", "with semantics"));
  if (console->ShouldStop()) return scene;
  scene.without = RunExperiment(WithoutSemantics(arguments), sequence.string(), console, {},
                                write_to(out / "without", "without semantics"));
  return scene;
}

Table MakeTable(const std::vector<DemoScene>& scenes) {
  Table table{
      .title = "Scenes",
      .note =
          "coverage: frames with a pose when their turn came. APE: rmse over the length of the path. "
          "recall:\nboxes of people and cars found by the detector, and after compensation. ms/frame: median "
          "of tracking.",
      .columns = {{.name = "scene", .is_text = true}, {.name = "semantics", .is_text = true}},
      .rows = {}};
  for (const char* name : {"coverage", "APE/path", "recall before", "recall after", "ms/frame"}) {
    table.columns.push_back({.name = name});
  }
  for (const DemoScene& scene : scenes) {
    for (const bool with : {true, false}) {
      const ExperimentRun& run = with ? scene.with : scene.without;
      const auto recall = [with](const DetectionMetrics& metrics) {
        return with ? fmt::format("{:.3f}", metrics.Recall()) : std::string("-");
      };
      table.rows.push_back({scene.name, with ? "with" : "without", Percent(run.Coverage(), 1),
                            Percent(run.ErrorShare()), recall(run.recall_before), recall(run.recall_after),
                            fmt::format("{:.1f}", run.summary.tracking_ms.median)});
    }
  }
  return table;
}

// Both paths of a scene over the truth.
nlohmann::ordered_json PathsOf(const DemoScene& scene) {
  PathPicture picture{.title = scene.name,
                      .note = "The path with semantics has the colours of its error; without it is orange.",
                      .start_s = scene.truth.front().timestamp_s,
                      .truth = scene.truth,
                      .tracks = {}};
  const auto add = [&picture](const std::string& name, const std::string& colour, const ExperimentRun& run) {
    if (!run.truth.has_value()) return;
    picture.tracks.push_back({.name = name,
                              .colour = colour,
                              .path = run.trajectory,
                              .shown_from_world = run.truth->ape.reference_from_estimate});
  };
  add("with semantics", "c1", scene.with);
  if (scene.with.truth.has_value()) picture.tracks.front().errors = scene.with.truth->ape.errors;
  add("without semantics", "c2", scene.without);
  return PathsSection(picture);
}

ReportPage MakePage(const std::vector<DemoScene>& scenes, const Table& table) {
  ReportPage page{.title = "The demo",
                  .subtitle = "An office and a street that the program rendered itself.",
                  .times_s = {}};
  nlohmann::ordered_json section = TableSection(table);
  for (size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<std::string>& row = table.rows[i];
    section["rows"][i][1] = {{"text", row[1]}, {"href", fmt::format("{}/{}/report.html", row[0], row[1])}};
  }
  page.sections.push_back(std::move(section));
  for (const DemoScene& scene : scenes) {
    if (!scene.truth.empty()) page.sections.push_back(PathsOf(scene));
    page.sections.push_back(FramesSection(scene.with.record.frames, 480));
    page.sections.back()["title"] = scene.name + ": frames";
  }
  return page;
}

void RunDemo(const DemoArguments& arguments, int* exit_code) {
  RunConsole console(arguments.quiet);
  std::vector<DemoScene> scenes;
  for (const char* name : kScenes) {
    if (console.ShouldStop()) break;
    scenes.push_back(RunScene(arguments, name, &console));
  }
  const Table table = MakeTable(scenes);
  fmt::print("\n{}\n", TerminalText(table));
  WritePage(std::filesystem::path(arguments.out) / "report.html", MakePage(scenes, table));
  const std::filesystem::path picture = std::filesystem::path(arguments.out) / "overview.png";
  WritePicture(picture.string(), DrawDemo(scenes));
  fmt::print("picture: {}\nreport: {}/report.html\nresults: {}/SCENE, images in sequence/\n",
             picture.string(), arguments.out, arguments.out);
  if (console.ShouldStop()) *exit_code = kExitInterrupted;
}

}  // namespace

void AddDemoCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "demo",
      "Render an office and a street where people and cars move, and run on them with semantics and without");
  const auto arguments = std::make_shared<DemoArguments>();
  DemoArguments& a = *arguments;
  command->add_option("--seed", a.seed, "Another seed is another place with other people");
  command->add_option("--frames", a.frames, "Frames of each scene at most")->check(CLI::Range(1, 1000000));
  a.detector = "builtin";
  a.out = kDefaultOut;
  AddRunOptions(command, "the picture and, below the scene's name, images and results", &a);
  command->add_flag("--force", a.force, "Replace a demo that is in --out");
  command->footer("overview.png in the results shows both runs at a glance.");
  command->callback([arguments, exit_code] { RunDemo(*arguments, exit_code); });
}

}  // namespace dynamic_slam
