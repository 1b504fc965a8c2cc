#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "bench_run.h"
#include "cmd_bench.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "truth_report.h"

namespace dynamic_slam {
namespace {

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
      {"- past views", {"dynamic.past_views=false"}},
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

Outcome RunVariant(const BenchArguments& arguments, const std::string& source, const Variant& variant,
                   RunConsole* console) {
  const BenchRun run = RunForBench(arguments, source, variant.assignments, console);
  Outcome outcome{source, variant.name, run.summary.Coverage(), run.system->FrameTrajectory(), {}, 0, {}};
  outcome.tracking_ms = run.summary.tracking_ms.median;
  if (run.record.truth.has_value() && outcome.trajectory.size() > 2) {
    outcome.truth = CompareWithTruth(*run.record.truth, outcome.trajectory);
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
    fmt::print("{:<28} {:<16} {:>9.3f} {:>9} {:>13} {:>12.1f}\n", ShortName(outcome.source), outcome.variant,
               outcome.coverage, ape, common, outcome.tracking_ms);
  }
}

nlohmann::ordered_json ToRows(const std::vector<Outcome>& outcomes) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
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
    rows.push_back(std::move(row));
  }
  return rows;
}

void RunAblation(const BenchArguments& arguments, int* exit_code) {
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
    WriteRows(arguments.out, "ablation", ToRows(outcomes));
    WriteBenchReport(arguments.out, "Ablation", arguments, ToRows(outcomes), {});
    fmt::print("results: {}\n", arguments.out);
  }
  if (console.ShouldStop()) *exit_code = kExitInterrupted;
}

}  // namespace

void AddAblationCommand(CLI::App* bench, int* exit_code) {
  CLI::App* command = bench->add_subcommand(
      "ablation",
      "What each part of the treatment of dynamic objects is worth: the same sequences without it");
  const auto arguments = std::make_shared<BenchArguments>();
  AddBenchOptions(command, "ablation.csv and ablation.json", arguments.get());
  command->get_option("--detector")->required();
  command->footer(
      "A run failed when it has a pose for less than half of the frames, or errs by more than 5% of the "
      "path;\n"
      "\"in common\" is the error over the frames that all other runs of the sequence have.\n"
      "Example:\n"
      "  dynamic_slam bench ablation walk cross --camera tum_fr1 --detector yolox_nano --out ablation");
  command->callback([arguments, exit_code] { RunAblation(*arguments, exit_code); });
}

}  // namespace dynamic_slam
