#include "cmd_demo.h"

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/sim/room.h"
#include "dynamic_slam/system/sequence_runner.h"
#include "dynamic_slam/system/slam_system.h"
#include "overview_picture.h"
#include "render_room.h"
#include "run_console.h"
#include "truth_report.h"

namespace dynamic_slam {
namespace {

constexpr const char* kDefaultOut = "out/demo";

struct DemoArguments {
  std::string out = kDefaultOut;
  RoomOptions room;
  bool force = false;
};

void DrawRun(const Room& room, const SlamSystem& system, const TruthComparison& comparison,
             const std::filesystem::path& out) {
  const Trajectory estimate = system.FrameTrajectory();
  const std::string title =
      fmt::format("Dynamic-SLAM in a rendered room: {} of {} frames have a pose, APE {}", estimate.size(),
                  room.options().frames, DescribeApe(comparison));
  const auto image_of = [&room](FrameId frame) { return room.Frame(static_cast<int>(frame.value())); };
  WritePicture((out / "overview.png").string(),
               DrawOverview(title, *system.map().Read(), image_of, comparison, estimate));
}

void RunDemo(const DemoArguments& arguments, int* exit_code) {
  const std::filesystem::path out = arguments.out, sequence = out / "sequence";
  // The default folder is the demo's own.
  if (!arguments.force && arguments.out != kDefaultOut) CheckHoldsNoSequence(sequence);
  const Room room(arguments.room);
  RenderRoom(room, sequence);

  SlamSystem system(room.options().camera, SystemOptions());
  RunConsole console(/*quiet=*/false);
  // From the files: faster than rendering again, and `run` on them gives the same result.
  const std::unique_ptr<FrameSource> source = OpenFrameSource(sequence);
  RunSummary summary = RunSequence(*source, system, console.Control());
  summary.source = sequence.string();
  console.End();
  WriteResults(out, system, summary);
  PrintSummary(summary);
  const std::optional<TruthComparison> comparison = ReportTruth(sequence, system.FrameTrajectory(), out);
  if (comparison.has_value()) DrawRun(room, system, *comparison, out);
  fmt::print("results: {}\nimages:  {}\n", out.string(), sequence.string());
  if (summary.failure != nullptr) std::rethrow_exception(summary.failure);
  if (summary.interrupted) *exit_code = kExitInterrupted;
}

}  // namespace

void AddDemoCommand(CLI::App& app, int* exit_code) {
  CLI::App* command =
      app.add_subcommand("demo", "Render a room, find the camera's path in it, and judge the result");
  const auto arguments = std::make_shared<DemoArguments>();
  DemoArguments& a = *arguments;
  command->add_option("--seed", a.room.seed, "Another seed is another room")->capture_default_str();
  command->add_option("--frames", a.room.frames, "Number of frames")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command->add_option("--out", a.out, "Folder for the results; the images go into sequence/ in it")
      ->capture_default_str();
  command->add_flag("--force", a.force, "Replace a sequence that is in --out");
  command->footer("overview.png in the results shows the run at a glance.");
  command->callback([arguments, exit_code] { RunDemo(*arguments, exit_code); });
}

}  // namespace dynamic_slam
