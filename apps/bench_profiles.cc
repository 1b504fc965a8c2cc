#include <algorithm>
#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "bench_units.h"
#include "cmd_bench.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/report/report_page.h"
#include "dynamic_slam/report/table.h"
#include "experiment.h"
#include "published_results.h"
#include "source_arguments.h"

namespace dynamic_slam {
namespace {

constexpr const char* kDefault = "default";

struct ProfileArguments : BenchArguments {
  std::string source;
  std::vector<std::string> profiles = {kDefault, "g3", "g4", "g5", "g6", "g7", "fast"};
  int runs = 3;
};

struct ProfileRuns {
  std::string name;
  SystemOptions options;
  std::vector<const UnitOutcome*> outcomes;

  std::optional<double> MeanOf(const std::vector<std::string>& path) const {
    return Mean(FiguresAt(outcomes, path));
  }
};

BenchUnit MakeUnit(const ProfileArguments& arguments, const std::string& profile, int run) {
  BenchUnit unit{.folder = fmt::format("{}/{}", profile, run),
                 .title = fmt::format("{}: profile {}, run {}", ShortName(arguments.source), profile, run),
                 .source = arguments.source,
                 .arguments = arguments};
  if (profile != kDefault) unit.arguments.config = profile;
  unit.arguments.assignments.push_back(fmt::format("seed={}", run));
  return unit;
}

// "G3" of "g3".
const PublishedRow* PublishedFor(const std::string& profile) {
  const std::vector<PublishedRow>& rows = PublishedProfiles().rows;
  std::string name = profile;
  std::transform(name.begin(), name.end(), name.begin(),
                 [](char c) { return c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c; });
  const auto at =
      std::find_if(rows.begin(), rows.end(), [&](const PublishedRow& row) { return row.sequence == name; });
  return at == rows.end() ? nullptr : &*at;
}

Table MakeTable(const std::vector<ProfileRuns>& all, const ProfileArguments& arguments) {
  Table table{
      .title = "Table 8: profiles",
      .note = fmt::format("Means of {} runs on {}; time is that of tracking, a frame. The paper's are of "
                          "walking_xyz on a mobile robot's board.",
                          arguments.runs, ShortName(arguments.source)),
      .columns = {{.name = "profile", .is_text = true},
                  {.name = "features", .group = "options"},
                  {.name = "levels", .group = "options"},
                  {.name = "matching, bits", .group = "options"},
                  {.name = "map points", .group = "options"}},
      .rows = {}};
  for (const Table::Column& column : PublishedProfiles().columns) table.columns.push_back(column);
  for (const char* name : {"Tracking, s", "of default", "Detection, s", "RMSE, m", "min–max", "coverage"}) {
    table.columns.push_back({.name = name, .group = "ours"});
  }
  const std::optional<double> usual_s = all.front().MeanOf({"tracking_mean_s"});
  for (const ProfileRuns& runs : all) {
    const SystemOptions& o = runs.options;
    std::vector<std::string> cells = {runs.name, std::to_string(o.orb.features), std::to_string(o.orb.levels),
                                      std::to_string(o.tracker.max_match_distance),
                                      std::to_string(o.tracker.initializer.two_view.min_points)};
    const PublishedRow* published = PublishedFor(runs.name);
    for (size_t i = 0; i < PublishedProfiles().columns.size(); ++i) {
      cells.push_back(published == nullptr ? "-" : published->figures[i]);
    }
    const auto number = [](const std::optional<double>& value, int digits) {
      return value.has_value() ? fmt::format("{:.{}f}", *value, digits) : "-";
    };
    const std::optional<double> time_s = runs.MeanOf({"tracking_mean_s"});
    std::vector<double> rmse = FiguresAt(runs.outcomes, {"frame_errors", "ape", "rmse"});
    cells.push_back(number(time_s, 4));
    cells.push_back(time_s.has_value() && usual_s.has_value() ? Percent(*time_s / *usual_s, 0) : "-");
    cells.push_back(number(runs.MeanOf({"detection_mean_s"}), 4));
    cells.push_back(number(Mean(rmse), 4));
    std::sort(rmse.begin(), rmse.end());
    cells.push_back(rmse.empty() ? "-" : fmt::format("{:.4f}–{:.4f}", rmse.front(), rmse.back()));
    cells.push_back(Percent(runs.MeanOf({"coverage_live"}), 1));
    table.rows.push_back(std::move(cells));
  }
  return table;
}

// Time and error of each profile (Fig. 16).
nlohmann::ordered_json Bars(const std::vector<ProfileRuns>& all, const std::string& title, const char* unit,
                            const char* colour, const std::vector<std::string>& path, double scale) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const ProfileRuns& runs : all) {
    std::vector<double> values = FiguresAt(runs.outcomes, path);
    std::sort(values.begin(), values.end());
    nlohmann::ordered_json value;
    if (!values.empty()) {
      value = {{"v", Rounded(scale * *Mean(values), 4)},
               {"lo", Rounded(scale * values.front(), 4)},
               {"hi", Rounded(scale * values.back(), 4)}};
    }
    rows.push_back({{"name", runs.name}, {"values", nlohmann::ordered_json::array({value})}});
  }
  return {{"type", "bars"},
          {"title", title},
          {"note", "Mean, least and greatest of the runs."},
          {"unit", unit},
          {"series", nlohmann::ordered_json::array({{{"name", "mean"}, {"colour", colour}}})},
          {"rows", std::move(rows)}};
}

void RunProfiles(const ProfileArguments& arguments, int* exit_code) {
  const std::filesystem::path out = arguments.out;
  std::vector<BenchUnit> units;
  std::vector<ProfileRuns> all;
  for (const std::string& profile : arguments.profiles) {
    all.emplace_back().name = profile;
    ApplyArguments(MakeUnit(arguments, profile, 1).arguments, &all.back().options);
  }
  // In turns, so that a time in which the machine is slow is that of all profiles.
  for (int run = 1; run <= arguments.runs; ++run) {
    for (const std::string& profile : arguments.profiles) units.push_back(MakeUnit(arguments, profile, run));
  }
  PrepareOutputFolder(out);
  RunConsole console(arguments.quiet);
  const std::vector<UnitOutcome> outcomes = RunUnits(out, units, 1, &console);
  for (size_t i = 0; i < units.size(); ++i) all[i % all.size()].outcomes.push_back(&outcomes[i]);
  const Table table = MakeTable(all, arguments);
  ReportPage page{.title = "Profiles on " + ShortName(arguments.source),
                  .subtitle = fmt::format("{} · detector {} · {} runs", arguments.source, arguments.detector,
                                          arguments.runs),
                  .times_s = {}};
  page.sections = {Bars(all, "Time of tracking", "ms", "c1", {"tracking_mean_s"}, 1000),
                   Bars(all, "Absolute pose error", "cm", "c2", {"frame_errors", "ape", "rmse"}, 100),
                   TableSection(table)};
  WriteTables(out, {table}, page);
  PrintEnd(out, units, outcomes);
  if (console.ShouldStop()) *exit_code = kExitInterrupted;
}

}  // namespace

void AddProfilesCommand(CLI::App* bench, int* exit_code) {
  CLI::App* command = bench->add_subcommand(
      "profiles",
      "What fewer features, levels and matches save, and cost (Table 8 and Fig. 16 of the paper)");
  const auto arguments = std::make_shared<ProfileArguments>();
  ProfileArguments& a = *arguments;
  a.out = "out/bench_profiles";
  a.detector = "yolox_nano";
  command->add_option("SOURCE", a.source, "A sequence, as of run")->required();
  command
      ->add_option("--profiles", a.profiles,
                   "Files, or names of " + ProfileHelp() + "; the first is what the others are compared with")
      ->delimiter(',')
      ->capture_default_str();
  AddRunsOption(command, &a.runs);
  command->add_option("--camera", a.camera, "As of run");
  AddRunOptions(command, "tables.txt, .csv, .json, report.html, and below it the results of each run", &a);
  AddSourceOptions(command, &a.source_options);
  command->callback([arguments, exit_code] { RunProfiles(*arguments, exit_code); });
}

}  // namespace dynamic_slam
