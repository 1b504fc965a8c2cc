#include "cmd_bench.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/system/sequence_runner.h"
#include "run_console.h"
#include "source_arguments.h"
#include "truth_report.h"

namespace dynamic_slam {
namespace {

// A run that has a pose for less than half of the frames, or is wrong by more than 5% of the path, failed:
// its error says nothing.
constexpr double kMinCoverage = 0.5, kMaxErrorShare = 0.05;

struct Variant {
  std::string name;
  std::vector<std::string> assignments;
};

const std::vector<Variant>& Variants() {
  static const std::vector<Variant> variants{
      {"none", {"dynamic.method=none"}},
      {"hard boxes", {"dynamic.method=boxes"}},
      {"paper", {"dynamic.method=paper"}},
      {"default", {}},
      {"- motion", {"dynamic.motion=false"}},
      {"- landmark odds", {"dynamic.landmark_odds=false"}},
      {"- more features", {"dynamic.more_features=false"}},
      {"- shield", {"dynamic.shield_hidden=false"}},
      {"- compensation", {"detector.compensation.method=none"}},
      {"- loops", {"loop.enabled=false"}},
  };
  return variants;
}

struct Outcome {
  std::string source, variant;
  double coverage = 0;
  Trajectory trajectory;
  std::optional<TruthComparison> truth;
  double tracking_ms = 0;
  std::optional<double> common_rmse_m;  // over the frames that all runs of the source that did not fail have

  bool Failed() const {
    return coverage < kMinCoverage ||
           (truth.has_value() && truth->ape.translation_m.rmse > kMaxErrorShare * truth->path_m);
  }
};

struct AblationArguments {
  std::vector<std::string> sources;
  std::string camera, detector, models, out, config;
  std::vector<std::string> assignments;
  FrameSourceOptions source_options;
  bool quiet = false;
};

// `{source}` in the name of a detector stands for the source's folder, so that each may have its own boxes.
std::string DetectorFor(std::string name, const std::string& source) {
  const std::string key = "{source}";
  const size_t at = name.find(key);
  return at == std::string::npos ? name : name.replace(at, key.size(), source);
}

Outcome RunVariant(const AblationArguments& arguments, const std::string& source_name, const Variant& variant,
                   RunConsole* console) {
  SystemOptions options;
  if (!arguments.config.empty()) LoadOptions(arguments.config, &options);
  ApplySet(&options, arguments.assignments);
  ApplySet(&options, variant.assignments);
  const std::unique_ptr<FrameSource> source = OpenFrameSource(source_name, arguments.source_options);
  SlamSystem system(ChooseCamera(arguments.camera, source_name, *source), options);
  system.SetDetector(MakeDetector(DetectorFor(arguments.detector, source_name), arguments.models));
  const RunSummary summary = RunSequence(*source, system, console->Control());
  console->End();
  if (summary.failure != nullptr) std::rethrow_exception(summary.failure);
  Outcome outcome{source_name, variant.name, summary.Coverage(), system.FrameTrajectory(), {}, 0, {}};
  outcome.tracking_ms = summary.tracking_ms.median;
  const std::optional<Trajectory> truth = LoadGroundTruth(source_name);
  if (truth.has_value() && outcome.trajectory.size() > 2) {
    outcome.truth = CompareWithTruth(*truth, outcome.trajectory);
  }
  return outcome;
}

// An error is only compared over the same frames.
void CompareOverCommonFrames(const std::string& source, std::vector<Outcome>* outcomes) {
  const std::optional<Trajectory> truth = LoadGroundTruth(source);
  if (!truth.has_value()) return;
  std::optional<std::set<double>> common;
  for (const Outcome& outcome : *outcomes) {
    if (outcome.source != source || outcome.Failed()) continue;
    std::set<double> stamps;
    for (const StampedPose& pose : outcome.trajectory) {
      if (!common.has_value() || common->contains(pose.timestamp_s)) stamps.insert(pose.timestamp_s);
    }
    common = std::move(stamps);
  }
  if (!common.has_value() || common->size() < 10) return;
  for (Outcome& outcome : *outcomes) {
    if (outcome.source != source || outcome.Failed()) continue;
    Trajectory part;
    for (const StampedPose& pose : outcome.trajectory) {
      if (common->contains(pose.timestamp_s)) part.push_back(pose);
    }
    outcome.common_rmse_m = CompareWithTruth(*truth, part).ape.translation_m.rmse;
  }
}

void PrintOutcomes(const std::vector<Outcome>& outcomes) {
  fmt::print("\n{:<28} {:<16} {:>9} {:>9} {:>13} {:>12}\n", "source", "variant", "coverage", "APE, m",
             "in common, m", "tracking, ms");
  for (const Outcome& outcome : outcomes) {
    const std::string ape =
        outcome.truth.has_value() ? fmt::format("{:.4f}", outcome.truth->ape.translation_m.rmse) : "-";
    const std::string common = outcome.Failed() ? "failed"
                               : outcome.common_rmse_m.has_value()
                                   ? fmt::format("{:.4f}", *outcome.common_rmse_m)
                                   : "-";
    fmt::print("{:<28} {:<16} {:>9.3f} {:>9} {:>13} {:>12.1f}\n",
               std::filesystem::path(outcome.source).lexically_normal().filename().string(), outcome.variant,
               outcome.coverage, ape, common, outcome.tracking_ms);
  }
}

void WriteOutcomes(const std::filesystem::path& folder, const std::vector<Outcome>& outcomes) {
  std::string csv = "source,variant,coverage,ape_m,path_m,failed,common_ape_m,tracking_ms\n";
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const Outcome& outcome : outcomes) {
    nlohmann::ordered_json row = {{"source", outcome.source},
                                  {"variant", outcome.variant},
                                  {"coverage", outcome.coverage},
                                  {"ape_m", nullptr},
                                  {"path_m", nullptr},
                                  {"failed", outcome.Failed()},
                                  {"common_ape_m", nullptr},
                                  {"tracking_ms", outcome.tracking_ms}};
    if (outcome.truth.has_value()) {
      row["ape_m"] = outcome.truth->ape.translation_m.rmse;
      row["path_m"] = outcome.truth->path_m;
    }
    if (outcome.common_rmse_m.has_value()) row["common_ape_m"] = *outcome.common_rmse_m;
    bool first = true;
    for (const auto& [key, value] : row.items()) {
      csv += (first ? "" : ",") + (value.is_null()     ? ""
                                   : value.is_string() ? value.get<std::string>()
                                                       : value.dump());
      first = false;
    }
    csv += "\n";
    json.push_back(std::move(row));
  }
  WriteFileAtomically(folder / "ablation.csv", csv);
  WriteFileAtomically(folder / "ablation.json", json.dump(2) + "\n");
}

void RunAblation(const AblationArguments& arguments, int* exit_code) {
  if (!arguments.out.empty()) PrepareOutputFolder(arguments.out);
  std::vector<Outcome> outcomes;
  RunConsole console(arguments.quiet);
  for (const std::string& source : arguments.sources) {
    for (const Variant& variant : Variants()) {
      if (console.ShouldStop()) break;
      if (!arguments.quiet) fmt::print(stderr, "{}: {}\n", source, variant.name);
      Outcome outcome = RunVariant(arguments, source, variant, &console);
      if (!console.ShouldStop()) outcomes.push_back(std::move(outcome));
    }
    CompareOverCommonFrames(source, &outcomes);
  }
  PrintOutcomes(outcomes);
  if (!arguments.out.empty()) {
    WriteOutcomes(arguments.out, outcomes);
    fmt::print("results: {}\n", arguments.out);
  }
  if (console.ShouldStop()) *exit_code = kExitInterrupted;
}

}  // namespace

void AddBenchCommand(CLI::App& app, int* exit_code) {
  CLI::App* bench = app.add_subcommand("bench", "Experiments over sequences");
  bench->require_subcommand(1);
  CLI::App* command = bench->add_subcommand(
      "ablation",
      "What each part of the treatment of dynamic objects is worth: the same sequences without it");
  const auto arguments = std::make_shared<AblationArguments>();
  AblationArguments& a = *arguments;
  command->add_option("SOURCE", a.sources, "Sequences, as of run")->required();
  command->add_option("--camera", a.camera, "As of run");
  command
      ->add_option("--detector", a.detector,
                   "As of run; {source} in it stands for the sequence: boxes:{source}/boxes.csv")
      ->required();
  command->add_option("--models", a.models, "Folder in which network files are looked for too");
  command->add_option("--config", a.config, "YAML file with options");
  command->add_option("--set", a.assignments, "One option, key=value; may be repeated")
      ->type_name("KEY=VALUE");
  command->add_option("--out", a.out, "Folder for ablation.csv and ablation.json");
  AddSourceOptions(command, &a.source_options);
  command->add_flag("--quiet", a.quiet, "No progress");
  command->footer(
      "A run failed when it has a pose for less than half of the frames, or errs by more than 5% of the "
      "path;\n"
      "\"in common\" is the error over the frames that all other runs of the sequence have.\n"
      "Example:\n"
      "  dynamic_slam bench ablation walk cross --camera tum_fr1 --detector yolox_nano --out ablation");
  command->callback([arguments, exit_code] { RunAblation(*arguments, exit_code); });
}

}  // namespace dynamic_slam
