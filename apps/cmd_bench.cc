#include "cmd_bench.h"

#include <CLI/CLI.hpp>

namespace dynamic_slam {

void AddBenchCommand(CLI::App& app, int* exit_code) {
  CLI::App* bench = app.add_subcommand("bench", "Experiments over sequences and rendered scenes");
  bench->require_subcommand(1);
  AddPaperCommands(bench, exit_code);
  AddProfilesCommand(bench, exit_code);
  AddAblationCommand(bench, exit_code);
  AddLoopsCommand(bench, exit_code);
  AddScaleCommand(bench, exit_code);
  AddRecallCommand(bench, exit_code);
  AddInterferenceCommand(bench, exit_code);
  AddInitCommand(bench, exit_code);
}

}  // namespace dynamic_slam
