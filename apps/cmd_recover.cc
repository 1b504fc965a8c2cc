#include "cmd_recover.h"

#include <filesystem>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/system/run_journal.h"
#include "dynamic_slam/system/run_results.h"

namespace dynamic_slam {
namespace {

// Of OUT/journal.1.csv, which a later run in OUT has kept, the results go to OUT/journal.1: those in OUT are
// not its own.
std::filesystem::path FolderFor(const std::filesystem::path& out_or_journal) {
  if (!std::filesystem::is_regular_file(out_or_journal)) return out_or_journal;
  if (out_or_journal.filename() == RunJournal::kFileName) return out_or_journal.parent_path();
  return out_or_journal.parent_path() / out_or_journal.stem();
}

void Recover(const std::filesystem::path& out_or_journal) {
  const RecoveredRun run = ReadJournal(out_or_journal);
  const std::filesystem::path folder = FolderFor(out_or_journal);
  if (!folder.empty()) PrepareOutputFolder(folder);
  WriteFileAtomically(folder / "frames.csv", run.frames_csv);
  WriteTrajectories(folder, run.trajectories);
  size_t poses = 0;
  for (const Trajectory& trajectory : run.trajectories) poses += trajectory.size();
  fmt::print("{} frames, {} of them with a pose, in {} map{}\n", run.frames, poses, run.trajectories.size(),
             run.trajectories.size() == 1 ? "" : "s");
  fmt::print("Poses are as they were when the frames came; what the map learned after is lost.\n");
  fmt::print("results: {}\n", folder.string());
}

}  // namespace

void AddRecoverCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("recover", "Trajectory and frames of a run that was killed before it wrote them");
  const auto folder = std::make_shared<std::string>();
  command
      ->add_option("OUT", *folder,
                   "Folder of its results, as --out had it, or a journal that a later run has kept there")
      ->required();
  command->callback([folder] { Recover(*folder); });
}

}  // namespace dynamic_slam
