#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "bench_units.h"
#include "cmd_bench.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/eval/paired_comparison.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/report/table.h"
#include "dynamic_slam/report/truth_comparison.h"
#include "experiment.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// A run with a pose for less of the frames failed, and one that errs by more of the path, as the demo asks:
// a SLAM that follows people errs by 1 to 10%.
constexpr double kMinCoverage = 0.5, kMaxErrorShare = 0.01;

// Of fewer poses an error says nothing.
constexpr size_t kFewestCommon = 10;

struct Variant {
  const char* name;
  const char* assignment;  // "": none
};

constexpr char kDefault[] = "default";

constexpr Variant kVariants[] = {
    {"none", "dynamic.method=none"},
    {"hard boxes", "dynamic.method=boxes"},
    {"paper", "dynamic.method=paper"},
    {kDefault, ""},
    {"- motion", "dynamic.motion=false"},
    {"- past views", "dynamic.past_views=false"},
    {"- landmark odds", "dynamic.landmark_odds=false"},
    {"- more features", "dynamic.more_features=false"},
    {"- shield", "dynamic.shield_hidden=false"},
    {"- compensation", "detector.compensation.method=none"},
    {"- loops", "loop.enabled=false"},
    {"+ depth seeds", "tracker.seeds_min_share=0.5"},
};

struct AblationArguments : BenchArguments {
  int runs = 1, jobs = 1;
};

// One run, and what came of it.
struct Run {
  BenchUnit unit;
  std::string variant;
  int number = 1;
  UnitOutcome outcome;
  // Over the frames that it and the default's run of that source and number have, and the default's over the
  // same; all of its own where that is the one, or failed. Infinity: failed. None: the truth is not known, or
  // next to no frame is in both.
  std::optional<double> rmse_m, default_rmse_m;

  std::optional<double> Figure(const std::vector<std::string>& path) const { return FigureAt(outcome, path); }
  double Coverage() const { return Figure({"coverage_live"}).value_or(0); }
  std::optional<double> Rmse() const { return Figure({"frame_errors", "ape", "rmse"}); }
  bool Failed() const {
    return Coverage() < kMinCoverage ||
           Rmse().value_or(0) > kMaxErrorShare * Figure({"frame_errors", "path_m"}).value_or(0);
  }
};

// Folders of "- past views" and the like.
std::string FolderName(std::string variant) {
  if (variant.starts_with("- ")) variant.replace(0, 1, "without");
  std::replace(variant.begin(), variant.end(), ' ', '_');
  return variant;
}

std::vector<Run> MakeRuns(const AblationArguments& arguments) {
  std::vector<Run> runs;
  std::set<std::string> names;
  for (const std::string& source : arguments.sources) {
    const std::string name = ShortName(source);
    CheckInputs(arguments, source);
    if (!names.insert(name).second) {
      throw InputError(source, "another SOURCE is called " + name + " too",
                       "The results of each are in a folder of its name: rename one.");
    }
    for (const Variant& variant : kVariants) {
      for (int number = 1; number <= arguments.runs; ++number) {
        BenchUnit unit{.folder = fmt::format("{}/{}/{}", name, FolderName(variant.name), number),
                       .title = fmt::format("{}: {}, run {}", name, variant.name, number),
                       .source = source,
                       .arguments = arguments};
        // Whom only the finished map finds, tracking did not.
        unit.arguments.assignments.push_back("backfill=false");
        unit.arguments.assignments.push_back(fmt::format("seed={}", number));
        if (*variant.assignment != 0) unit.arguments.assignments.push_back(variant.assignment);
        runs.push_back({std::move(unit), variant.name, number, {}, {}, {}});
      }
    }
  }
  return runs;
}

// An error is only compared over the same frames.
void CompareWithDefault(const fs::path& out, const Run& standard, Run* run) {
  const auto of_all_frames = [](const Run& one) {
    return one.Failed() ? std::numeric_limits<double>::infinity() : one.Rmse();
  };
  run->rmse_m = of_all_frames(*run);
  run->default_rmse_m = of_all_frames(standard);
  if (run == &standard || run->Failed() || standard.Failed()) return;
  const std::optional<Trajectory> truth = LoadGroundTruth(run->unit.source);
  if (!truth.has_value()) return;
  Trajectory own = ReadTumTrajectory(out / run->unit.folder / "trajectory.txt");
  Trajectory others = ReadTumTrajectory(out / standard.unit.folder / "trajectory.txt");
  const auto keep_common = [](const Trajectory& other, Trajectory* trajectory) {
    std::set<double> stamps;
    for (const StampedPose& pose : other) stamps.insert(pose.timestamp_s);
    std::erase_if(*trajectory, [&](const StampedPose& pose) { return !stamps.contains(pose.timestamp_s); });
  };
  keep_common(others, &own);
  keep_common(own, &others);
  if (own.size() < kFewestCommon) {
    run->rmse_m = run->default_rmse_m = std::nullopt;
    return;
  }
  run->rmse_m = CompareWithTruth(*truth, own).ape.translation_m.rmse;
  run->default_rmse_m = CompareWithTruth(*truth, others).ape.translation_m.rmse;
}

void CompareWithDefaults(const fs::path& out, std::vector<Run>* runs) {
  for (Run& run : *runs) {
    for (const Run& standard : *runs) {
      if (standard.variant == kDefault && standard.unit.source == run.unit.source &&
          standard.number == run.number)
        CompareWithDefault(out, standard, &run);
    }
  }
}

Json ToRows(const std::vector<Run>& runs) {
  Json rows = Json::array();
  for (const Run& run : runs) {
    rows.push_back({{"source", run.unit.source},
                    {"variant", run.variant},
                    {"run", run.number},
                    {"coverage", run.Coverage()},
                    {"ape_m", OrNull(run.Rmse())},
                    {"path_m", OrNull(run.Figure({"frame_errors", "path_m"}))},
                    {"failed", run.Failed()},
                    {"common_ape_m", OrNull(run.rmse_m)},
                    {"default_ape_m", OrNull(run.default_rmse_m)},
                    {"tracking_ms", 1000 * run.Figure({"tracking_median_s"}).value_or(0)}});
  }
  return rows;
}

// "crowd" of "films/crowd21": films of one kind are counted together.
std::string KindOf(const std::string& source) {
  const std::string name = ShortName(source);
  const size_t end = name.find_last_not_of("0123456789");
  return end == std::string::npos ? name : name.substr(0, end + 1);
}

std::vector<const Run*> OfVariant(const std::vector<Run>& runs, const Variant& variant) {
  std::vector<const Run*> chosen;
  for (const Run& run : runs) {
    if (run.variant == variant.name) chosen.push_back(&run);
  }
  return chosen;
}

std::vector<const Run*> OfKind(std::vector<const Run*> runs, const std::string& kind) {
  std::erase_if(runs, [&](const Run* run) { return KindOf(run->unit.source) != kind; });
  return runs;
}

// "1.09": the error over the default's, pair by pair; of the default itself, the error.
std::string ErrorCell(const std::vector<const Run*>& runs) {
  std::vector<double> errors;
  std::vector<ErrorPair> pairs;
  for (const Run* run : runs) {
    if (!run->rmse_m.has_value() || !run->default_rmse_m.has_value()) continue;
    errors.push_back(*run->rmse_m);
    pairs.push_back({*run->rmse_m, *run->default_rmse_m});
  }
  if (errors.empty()) return "-";
  const auto print = [](double value, const char* format) {
    return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "failed";
  };
  if (runs.front()->variant == kDefault) return print(*Median(errors), "{:.4f} m");
  const std::optional<PairedComparison> comparison = ComparePairs(pairs);
  if (!comparison.has_value()) return "-";
  return print(comparison->median_ratio, "{:.2f}") + (comparison->IsNoChance() ? "*" : "");
}

Table MakeTable(const std::vector<Run>& runs) {
  std::vector<std::string> kinds;
  for (const Run& run : runs) {
    const std::string kind = KindOf(run.unit.source);
    if (std::count(kinds.begin(), kinds.end(), kind) == 0) kinds.push_back(kind);
  }
  if (kinds.size() == 1) kinds.clear();  // which is all
  const std::string errors = "APE over the default's";
  Table table{
      .title = "Ablation",
      .note =
          "A run failed that has a pose for less than half of the frames, or errs by more than 1% "
          "of the path. Errors are over the frames that a run and the default's of the same source and "
          "number have, and divided by the default's; medians of the runs. *: so many of them are better, "
          "or worse, as chance gives in less than one case of twenty (sign test).",
      .columns = {{.name = "variant", .is_text = true},
                  {.name = "failed"},
                  {.name = "mean", .group = "coverage"},
                  {.name = "least", .group = "coverage"},
                  {.name = "all", .group = errors}},
      .rows = {}};
  for (const std::string& kind : kinds) table.columns.push_back({.name = kind, .group = errors});
  table.columns.push_back({.name = "worst", .group = errors});
  for (const Variant& variant : kVariants) {
    const std::vector<const Run*> of_variant = OfVariant(runs, variant);
    if (of_variant.empty()) continue;
    std::vector<double> coverages;
    std::optional<double> worst;
    size_t failed = 0;
    for (const Run* run : of_variant) {
      failed += run->Failed() ? 1 : 0;
      coverages.push_back(run->Coverage());
      if (!run->Failed()) worst = std::max(worst, run->rmse_m);
    }
    std::vector<std::string> cells = {
        variant.name, fmt::format("{} of {}", failed, of_variant.size()), Percent(Mean(coverages), 1),
        Percent(*std::min_element(coverages.begin(), coverages.end()), 1), ErrorCell(of_variant)};
    for (const std::string& kind : kinds) cells.push_back(ErrorCell(OfKind(of_variant, kind)));
    cells.push_back(worst.has_value() ? fmt::format("{:.4f} m", *worst) : "-");
    table.rows.push_back(std::move(cells));
  }
  return table;
}

void RunAblation(const AblationArguments& arguments, int* exit_code) {
  const fs::path out = arguments.out;
  std::vector<Run> runs = MakeRuns(arguments);
  PrepareOutputFolder(out);
  RunConsole console(arguments.quiet || arguments.jobs > 1);
  std::vector<BenchUnit> units;
  for (const Run& run : runs) units.push_back(run.unit);
  const std::vector<UnitOutcome> outcomes = RunUnits(out, units, arguments.jobs, &console);
  for (size_t i = 0; i < runs.size(); ++i) runs[i].outcome = outcomes[i];
  std::erase_if(runs, [](const Run& run) { return !run.outcome.figures.has_value(); });
  CompareWithDefaults(out, &runs);
  const Json rows = ToRows(runs);
  WriteRows(out, "ablation_runs", rows);
  const Table table = MakeTable(runs);
  ReportPage page{
      .title = table.title,
      .subtitle = fmt::format("detector {} · version {}", arguments.detector, DYNAMIC_SLAM_VERSION),
      .times_s = {}};
  page.sections.push_back(TableSection(table));
  std::vector<std::string> folders;
  for (const Run& run : runs) folders.push_back(run.unit.folder);
  if (!rows.empty()) page.sections.push_back(RunSection(TableOfRows("Runs", rows), folders));
  WriteTables(out, {table}, page);
  PrintEnd(out, units, outcomes);
  if (console.ShouldStop()) *exit_code = kExitInterrupted;
}

}  // namespace

void AddAblationCommand(CLI::App* bench, int* exit_code) {
  CLI::App* command = bench->add_subcommand(
      "ablation",
      "What each part of the treatment of dynamic objects is worth: the same sequences without it");
  const auto arguments = std::make_shared<AblationArguments>();
  AblationArguments& a = *arguments;
  a.out = "out/bench_ablation";
  AddBenchOptions(command, "tables.txt, .csv, .json, report.html, and below it the results of each run", &a);
  command->get_option("--detector")->required();
  AddRunsOption(command, &a.runs);
  AddJobsOption(command, &a.jobs);
  command->footer(
      "Films whose names differ in a number at their end only, as crowd21 and crowd22, are of one kind.\n"
      "What is done is not done again: the same command goes on after an interrupt.\n"
      "Example:\n"
      "  dynamic_slam bench ablation walk cross21 cross22 --camera tum_fr1 --detector yolox_nano --runs 3");
  command->callback([arguments, exit_code] { RunAblation(*arguments, exit_code); });
}

}  // namespace dynamic_slam
