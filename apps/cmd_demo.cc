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

void PrintTable(const std::vector<DemoScene>& scenes) {
  fmt::print("\n{:<14} {:<10} {:>9} {:>10} {:>14} {:>13} {:>10}\n", "scene", "semantics", "coverage",
             "APE/path", "recall before", "recall after", "ms/frame");
  for (const DemoScene& scene : scenes) {
    for (const bool with : {true, false}) {
      const ExperimentRun& run = with ? scene.with : scene.without;
      const auto recall = [with](const DetectionMetrics& metrics) {
        return with ? fmt::format("{:.3f}", metrics.Recall()) : std::string("-");
      };
      fmt::print("{:<14} {:<10} {:>9} {:>10} {:>14} {:>13} {:>10.1f}\n", scene.name,
                 with ? "with" : "without", Percent(run.Coverage(), 1), Percent(run.ErrorShare()),
                 recall(run.recall_before), recall(run.recall_after), run.summary.tracking_ms.median);
    }
  }
  fmt::print(
      "coverage: frames with a pose when their turn came. APE: rmse over the length of the path. recall: "
      "boxes\n"
      "of people and cars found by the detector, and after compensation. ms/frame: median of tracking.\n\n");
}

void RunDemo(const DemoArguments& arguments, int* exit_code) {
  RunConsole console(arguments.quiet);
  std::vector<DemoScene> scenes;
  for (const char* name : kScenes) {
    if (console.ShouldStop()) break;
    scenes.push_back(RunScene(arguments, name, &console));
  }
  PrintTable(scenes);
  const std::filesystem::path picture = std::filesystem::path(arguments.out) / "overview.png";
  WritePicture(picture.string(), DrawDemo(scenes));
  fmt::print("picture: {}\nresults: {}/SCENE, images in sequence/\n", picture.string(), arguments.out);
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
