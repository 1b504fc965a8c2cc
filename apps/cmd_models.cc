#include "cmd_models.h"

#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/semantics/network_files.h"

namespace dynamic_slam {
namespace {

struct ModelsArguments {
  std::vector<std::string> detectors;
  std::string models;
};

std::string State(const NetworkFile& file) {
  if (!file.found) return "missing";
  const std::string wrong = file.WrongSha256();
  if (!wrong.empty())
    return fmt::format("{} (another file than expected: its SHA-256 is {})", file.found->string(), wrong);
  return fmt::format("{}{}", file.found->string(),
                     file.wanted.sha256.empty() ? "" : " (SHA-256 as expected)");
}

void PrintDetector(const DetectorFile& detector, const std::vector<std::filesystem::path>& folders) {
  const std::vector<NetworkFile> files = FindNetworkFiles(detector, folders);
  bool is_ready = true;
  for (const NetworkFile& file : files) is_ready = is_ready && file.found.has_value();
  fmt::print("{:<18} {:<8} {}\n", detector.name, is_ready ? "ready" : "missing", detector.options.about);
  for (const NetworkFile& file : files)
    fmt::print("  {:<8} {}: {}\n", file.role, file.wanted.file, State(file));
  fmt::print("  {:<8} {}\n", "licence", detector.options.licence);
  if (!is_ready) fmt::print("  {:<8} {}\n", "get from", detector.options.origin);
}

void RunModels(const ModelsArguments& arguments) {
  const std::vector<std::filesystem::path> folders = ModelFolders(arguments.models);
  const std::vector<std::string> names =
      arguments.detectors.empty() ? ConfigNames("detectors") : arguments.detectors;
  for (const std::string& name : names)
    PrintDetector(ReadDetectorFile(FindConfig("detectors", "detector", name)), folders);
  fmt::print("Files are looked for beside the detector file, and in");
  for (const std::filesystem::path& folder : folders) fmt::print(" {}", folder.string());
  fmt::print(".\n");
}

}  // namespace

void AddModelsCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("models", "Say which networks are there, and where to get the others");
  const auto arguments = std::make_shared<ModelsArguments>();
  command->add_option("DETECTOR", arguments->detectors, "Names or detector files (default: all known ones)");
  command->add_option("--models", arguments->models, "Folder in which network files are looked for too");
  command->footer("Example:\n  dynamic_slam models --models ~/networks");
  command->callback([arguments] { RunModels(*arguments); });
}

}  // namespace dynamic_slam
