#include "cmd_view.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include <fmt/core.h>
#include <unistd.h>

#include "dynamic_slam/viewer/replay.h"
#include "run_console.h"
#include "run_viewer.h"

namespace dynamic_slam {
namespace {

struct ViewArguments {
  std::string out;
  ViewerArguments viewer;
};

void View(const ViewArguments& arguments) {
  std::filesystem::path file = arguments.out;
  if (std::filesystem::is_directory(file)) file /= kRecordingName;
  const Replay replay(file, ServerOptionsOf(arguments.viewer));
  const RunConsole console(true);
  fmt::print("{} frames; open {} in a browser, and end this with Ctrl-C\n", replay.FrameCount(),
             replay.url());
  std::fflush(stdout);
  while (!console.ShouldStop()) usleep(50'000);
}

}  // namespace

void AddViewCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand("view", "Show a recorded run in a browser, back and forth");
  const auto arguments = std::make_shared<ViewArguments>();
  command->add_option("OUT", arguments->out, "Results of a run with --record, or the recording in them")
      ->required();
  AddServerOptions(command, "--port", &arguments->viewer);
  command->footer(
      "Example:\n  dynamic_slam run office --record --out out/office && dynamic_slam view out/office");
  command->callback([arguments] { View(*arguments); });
}

}  // namespace dynamic_slam
