#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "bench_units.h"
#include "cmd_bench.h"
#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/report/report_page.h"
#include "dynamic_slam/report/table.h"
#include "experiment.h"
#include "published_results.h"
#include "source_arguments.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

struct PaperArguments : BenchArguments {
  std::string root;
  std::vector<std::string> sequences;
  int runs = 3, jobs = 1;
  bool is_kitti = false;
};

struct BenchSequence {
  std::string name;  // as in the published tables, such as "fr3_walking_xyz" or "00"
  fs::path folder;
};

// Median and spread are taken over these.
struct SequenceRuns {
  BenchSequence sequence;
  std::vector<const UnitOutcome*> with, without;
};

// "fr3_walking_xyz" of "rgbd_dataset_freiburg3_walking_xyz".
std::string TumName(std::string folder) {
  for (const std::string prefix : {"rgbd_dataset_", "tum_"}) {
    if (folder.starts_with(prefix)) folder.erase(0, prefix.size());
  }
  if (folder.starts_with("freiburg")) folder.replace(0, 8, "fr");
  return folder;
}

std::vector<std::string> PaperSequences(bool is_kitti) {
  if (is_kitti) return {"00", "02", "03", "04", "05", "06", "07", "08", "09", "10"};
  return {"fr2_desk_with_person", "fr3_sitting_halfsphere", "fr3_sitting_rpy",
          "fr3_sitting_static",   "fr3_sitting_xyz",        "fr3_walking_halfsphere",
          "fr3_walking_rpy",      "fr3_walking_static",     "fr3_walking_xyz"};
}

// All that are there, by name.
std::map<std::string, fs::path> SequencesBelow(const fs::path& root, bool is_kitti) {
  const fs::path folder = is_kitti && fs::is_directory(root / "sequences") ? root / "sequences" : root;
  std::map<std::string, fs::path> found;
  std::error_code error;
  for (const auto& item : fs::directory_iterator(folder, error)) {
    const std::string name = item.path().filename().string();
    if (is_kitti && fs::is_directory(item.path() / "image_0")) found[name] = item.path();
    if (!is_kitti && fs::is_regular_file(item.path() / "rgb.txt")) found[TumName(name)] = item.path();
  }
  if (error || found.empty()) {
    throw InputError(root.string(), error ? error.message() : "holds no sequence",
                     is_kitti
                         ? "--root is KITTI's odometry folder, with sequences/00/image_0 and poses/00.txt."
                         : "--root is a folder of sequences, each with rgb.txt and groundtruth.txt.");
  }
  return found;
}

// Those that were asked for, else the paper's, else all; what is missing is named.
std::vector<BenchSequence> ChooseSequences(const PaperArguments& arguments,
                                           std::vector<std::string>* missing) {
  const std::map<std::string, fs::path> found = SequencesBelow(arguments.root, arguments.is_kitti);
  std::vector<std::string> wanted = arguments.sequences;
  if (wanted.empty()) wanted = PaperSequences(arguments.is_kitti);
  std::vector<BenchSequence> chosen;
  for (std::string name : wanted) {
    if (!arguments.is_kitti) name = TumName(name);
    const auto at = found.find(name);
    if (at != found.end()) {
      chosen.push_back({at->first, at->second});
    } else {
      missing->push_back(name);
    }
  }
  if (arguments.sequences.empty() && chosen.empty()) {
    for (const auto& [name, folder] : found) chosen.push_back({name, folder});
  }
  return chosen;
}

// The camera of a TUM sequence is known by its name.
std::string CameraFor(const PaperArguments& arguments, const BenchSequence& sequence) {
  if (!arguments.camera.empty() || arguments.is_kitti || fs::exists(sequence.folder / "camera.yaml")) {
    return arguments.camera;
  }
  const std::string camera = "tum_" + sequence.name.substr(0, 3);
  const std::vector<std::string> known = ConfigNames("cameras");
  return std::count(known.begin(), known.end(), camera) > 0 ? camera : "";
}

// An offline run repeats itself to the byte: each has a seed of its own.
BenchUnit MakeUnit(const PaperArguments& arguments, const BenchSequence& sequence, bool with, int run) {
  const char* variant = with ? "with" : "without";
  BenchUnit unit{.folder = fmt::format("{}/{}/{}", sequence.name, variant, run),
                 .title = fmt::format("{}, {} semantics, run {}", sequence.name, variant, run),
                 .source = sequence.folder.string(),
                 .arguments = arguments};
  unit.arguments.camera = CameraFor(arguments, sequence);
  unit.arguments.assignments.push_back(fmt::format("seed={}", run));
  if (!with) unit.arguments.detector = "none";
  return unit;
}

// With so many decimals; with more where these would leave less than two figures.
std::string Decimal(double value, int decimals = 3) {
  constexpr int kMostDecimals = 6;
  if (value > 0)
    decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(value))), decimals, kMostDecimals);
  return fmt::format("{:.{}f}", value, decimals);
}

std::string Number(const std::optional<double>& value, double unit, int decimals = 3) {
  return value.has_value() ? Decimal(unit * *value, decimals) : "x";
}

// Eq. (14): by how much the error is less with semantics.
std::string Improvement(const std::optional<double>& with, const std::optional<double>& without) {
  if (!with.has_value() || !without.has_value() || *without <= 0) return "-";
  return fmt::format("{:.2f}%", 100 * (1 - *with / *without));
}

std::string MinMax(const std::vector<double>& values, double unit) {
  if (values.empty()) return "-";
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return fmt::format("{}–{}", Decimal(unit * *low), Decimal(unit * *high));
}

// What a table says of our own runs.
struct ErrorTable {
  std::string title, note;
  const PublishedTable* published;
  std::string poses;   // "keyframe_errors" or "frame_errors"
  std::string metric;  // "ape", "rpe_translation", ...
  double unit = 1;     // such as 100 for cm
  bool has_median = false, has_scale = false, has_coverage = false;
};

using Cells = std::vector<std::string>;

Cells OwnCells(const ErrorTable& table, const SequenceRuns& runs) {
  const auto values = [&](bool with, const char* statistic) {
    return FiguresAt(with ? runs.with : runs.without, {table.poses, table.metric, statistic});
  };
  const auto median = [&](bool with, const char* statistic) { return Median(values(with, statistic)); };
  Cells cells;
  for (const bool with : {false, true}) {
    cells.push_back(Number(median(with, "rmse"), table.unit));
    cells.push_back(MinMax(values(with, "rmse"), table.unit));
    cells.push_back(Number(median(with, "mean"), table.unit));
    if (table.has_median) cells.push_back(Number(median(with, "median"), table.unit));
    cells.push_back(Number(median(with, "std"), table.unit));
  }
  if (table.has_scale) cells.push_back(Number(Median(FiguresAt(runs.with, {table.poses, "scale"})), 1));
  cells.push_back(Improvement(median(true, "rmse"), median(false, "rmse")));
  if (!table.has_coverage) return cells;
  for (const bool with : {false, true}) {
    for (const char* key : {"coverage_live", "coverage_backfilled"}) {
      cells.push_back(Percent(Median(FiguresAt(with ? runs.with : runs.without, {key})), 1));
    }
  }
  return cells;
}

std::vector<Table::Column> OwnColumns(const ErrorTable& table) {
  std::vector<Table::Column> columns;
  for (const char* group : {"ours without semantics", "ours with"}) {
    columns.push_back({.name = "RMSE", .group = group});
    columns.push_back({.name = "min–max", .group = group});
    columns.push_back({.name = "Mean", .group = group, .on_terminal = false});
    if (table.has_median) columns.push_back({.name = "Median", .group = group, .on_terminal = false});
    columns.push_back({.name = "Std.", .group = group, .on_terminal = false});
  }
  if (table.has_scale) columns.push_back({.name = "Scale", .group = "ours with", .on_terminal = false});
  columns.push_back({.name = "Imp.", .group = "ours with"});
  if (!table.has_coverage) return columns;
  for (const char* group : {"coverage without", "coverage with"}) {
    columns.push_back({.name = "live", .group = group});
    columns.push_back({.name = "back-filled", .group = group});
  }
  return columns;
}

// A row for each sequence that was run or published, in the published order.
Table MakeErrorTable(const ErrorTable& kind, const std::vector<SequenceRuns>& all) {
  Table table{
      .title = kind.title, .note = kind.note, .columns = {{.name = "sequence", .is_text = true}}, .rows = {}};
  const std::vector<Table::Column> own = OwnColumns(kind);
  table.columns.insert(table.columns.end(), kind.published->columns.begin(), kind.published->columns.end());
  table.columns.insert(table.columns.end(), own.begin(), own.end());
  std::set<std::string> shown;
  const auto add = [&](const std::string& name, const Cells& published) {
    if (!shown.insert(name).second) return;
    const auto runs =
        std::find_if(all.begin(), all.end(), [&](const SequenceRuns& r) { return r.sequence.name == name; });
    Cells cells = {name};
    cells.insert(cells.end(), published.begin(), published.end());
    const Cells figures = runs == all.end() ? Cells(own.size(), "-") : OwnCells(kind, *runs);
    cells.insert(cells.end(), figures.begin(), figures.end());
    table.rows.push_back(std::move(cells));
  };
  for (const PublishedRow& row : kind.published->rows) add(row.sequence, row.figures);
  for (const SequenceRuns& runs : all) add(runs.sequence.name, Cells(kind.published->columns.size(), "-"));
  return table;
}

Table MakeTimeTable(const std::vector<SequenceRuns>& all, const PaperArguments& arguments) {
  Table table{
      .title = "Table 4: time of tracking, s",
      .note = fmt::format("Ours are means of {} runs, {} at a time, on this machine; the paper's are of "
                          "walking_xyz on the authors' laptop with a GPU.",
                          arguments.runs, arguments.jobs),
      .columns = {{.name = "sequence", .is_text = true}, {.name = "system", .is_text = true}},
      .rows = {}};
  const PublishedTable& published = PublishedTimes();
  table.columns.insert(table.columns.end(), published.columns.begin(), published.columns.end());
  for (const PublishedRow& row : published.rows) {
    Cells cells = {"fr3_walking_xyz", row.sequence + " (paper)"};
    cells.insert(cells.end(), row.figures.begin(), row.figures.end());
    table.rows.push_back(std::move(cells));
  }
  for (const SequenceRuns& runs : all) {
    for (const bool with : {false, true}) {
      const auto mean = [&](const char* key) {
        return Mean(FiguresAt(with ? runs.with : runs.without, {key}));
      };
      table.rows.push_back({runs.sequence.name, with ? "ours with semantics" : "ours without",
                            Number(mean("tracking_median_s"), 1, 4), Number(mean("tracking_mean_s"), 1, 4),
                            Number(mean("tracking_total_s"), 1, 2)});
    }
  }
  return table;
}

// What the truth spans, which Table 5 names for each sequence.
Table MakeSizeTable(const std::vector<SequenceRuns>& all) {
  Table table{
      .title = "Sequences as run",
      .note = "Length: of the part of the truth that has estimated poses. Dimensions: along x, y and z.",
      .columns = {{.name = "sequence", .is_text = true},
                  {.name = "images"},
                  {.name = "length, m"},
                  {.name = "dimensions, m", .is_text = true},
                  {.name = "runs done"}},
      .rows = {}};
  for (const SequenceRuns& runs : all) {
    const auto any = std::find_if(runs.with.begin(), runs.with.end(),
                                  [](const auto* o) { return o->figures.has_value(); });
    if (any == runs.with.end()) continue;
    const nlohmann::ordered_json& figures = *(*any)->figures;
    std::string dimensions = "-";
    if (!figures["dimensions_m"].is_null()) {
      const auto d = figures["dimensions_m"].get<std::vector<double>>();
      dimensions = fmt::format("{:.1f} × {:.1f} × {:.1f}", d[0], d[1], d[2]);
    }
    const size_t done =
        FiguresAt(runs.with, {"frames_total"}).size() + FiguresAt(runs.without, {"frames_total"}).size();
    table.rows.push_back({runs.sequence.name, figures["frames_total"].dump(),
                          Number(Median(FiguresAt(runs.with, {"frame_errors", "path_m"})), 1, 2), dimensions,
                          fmt::format("{} of {}", done, runs.with.size() + runs.without.size())});
  }
  return table;
}

std::vector<Table> MakeTables(const std::vector<SequenceRuns>& all, const PaperArguments& arguments) {
  const std::string median = fmt::format(
      "Ours: median of {} runs over keyframes, as the paper has it; x: no error, as too few poses. ",
      arguments.runs);
  std::vector<ErrorTable> kinds;
  static const PublishedTable kNothing;
  const std::string imp = "Imp.: Eq. 14, against the same without semantics.";
  if (arguments.is_kitti) {
    kinds = {
        {"Table 5: absolute pose error, m", median + imp, &PublishedKittiApe(), "keyframe_errors", "ape", 1,
         true, true, false},
        {"Table 5, all frames", "Over all frames with a pose.", &kNothing, "frame_errors", "ape", 1, true,
         true, true},
        {"Table 6: relative pose error, translation, m per frame", median, &PublishedKittiRpeTranslation(),
         "keyframe_errors", "rpe_translation"},
        {"Table 6, all frames", "From each frame with a pose to the next.", &kNothing, "frame_errors",
         "rpe_translation"},
        {"Table 7: relative pose error, rotation, deg per m",
         median + "Over pairs 1 m apart, as evo chooses them.", &PublishedKittiRpeRotation(),
         "keyframe_errors", "rpe_rotation_per_m"},
        {"Table 7, all frames", "Over pairs 1 m apart.", &kNothing, "frame_errors", "rpe_rotation_per_m"}};
  } else {
    kinds = {
        {"Table 1: absolute pose error, cm", median + imp, &PublishedTumApe(), "keyframe_errors", "ape", 100,
         true, false, false},
        {"Table 1, all frames", "Beside what others report, with the share of the frames that they track.",
         &PublishedTumOthers(), "frame_errors", "ape", 100, true, false, true},
        {"Table 2: relative pose error, translation, cm per frame", median, &PublishedTumRpeTranslation(),
         "keyframe_errors", "rpe_translation", 100},
        {"Table 2, all frames", "From each frame with a pose to the next.", &kNothing, "frame_errors",
         "rpe_translation", 100},
        {"Table 3: relative pose error, rotation, deg per frame", median, &PublishedTumRpeRotation(),
         "keyframe_errors", "rpe_rotation"},
        {"Table 3, all frames", "From each frame with a pose to the next.", &kNothing, "frame_errors",
         "rpe_rotation"}};
  }
  std::vector<Table> tables;
  for (const ErrorTable& kind : kinds) tables.push_back(MakeErrorTable(kind, all));
  tables.push_back(MakeTimeTable(all, arguments));
  tables.push_back(MakeSizeTable(all));
  return tables;
}

nlohmann::ordered_json ErrorBars(const std::vector<SequenceRuns>& all, const PaperArguments& arguments) {
  const double unit = arguments.is_kitti ? 1 : 100;
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const SequenceRuns& runs : all) {
    nlohmann::ordered_json values = nlohmann::ordered_json::array();
    for (const bool with : {true, false}) {
      std::vector<double> rmse = FiguresAt(with ? runs.with : runs.without, {"frame_errors", "ape", "rmse"});
      std::sort(rmse.begin(), rmse.end());
      values.push_back(nullptr);
      if (rmse.empty()) continue;
      values.back() = {{"v", Rounded(unit * *Median(rmse), 4)},
                       {"lo", Rounded(unit * rmse.front(), 4)},
                       {"hi", Rounded(unit * rmse.back(), 4)}};
    }
    rows.push_back({{"name", runs.sequence.name}, {"values", std::move(values)}});
  }
  return {
      {"type", "bars"},
      {"title", "Absolute pose error over all frames"},
      {"short", "Errors"},
      {"note", "Median, least and greatest of the runs."},
      {"unit", arguments.is_kitti ? "m" : "cm"},
      {"series", {{{"name", "with semantics"}, {"colour", "c1"}}, {{"name", "without"}, {"colour", "c2"}}}},
      {"rows", std::move(rows)}};
}

Table MakeRunTable(const std::vector<BenchUnit>& units, const std::vector<UnitOutcome>& outcomes) {
  Table table{.title = "Runs",
              .note = "",
              .columns = {{.name = "run", .is_text = true},
                          {.name = "coverage"},
                          {.name = "APE, m"},
                          {.name = "failure", .is_text = true}},
              .rows = {}};
  for (size_t i = 0; i < units.size(); ++i) {
    std::string failure = outcomes[i].failure;
    std::replace(failure.begin(), failure.end(), '\n', ' ');
    table.rows.push_back({units[i].folder, Percent(FigureAt(outcomes[i], {"coverage_live"}), 1),
                          Number(FigureAt(outcomes[i], {"frame_errors", "ape", "rmse"}), 1, 4), failure});
  }
  return table;
}

void RunPaper(const PaperArguments& arguments, int* exit_code) {
  const fs::path out = arguments.out;
  std::vector<std::string> missing;
  const std::vector<BenchSequence> sequences = ChooseSequences(arguments, &missing);
  if (arguments.detector.find("{source}") == std::string::npos)
    MakeDetector(arguments.detector, arguments.models);
  PrepareOutputFolder(out);
  for (const std::string& name : missing) fmt::print("{}: not in {}, skipped\n", name, arguments.root);
  std::vector<BenchUnit> units;
  for (const BenchSequence& sequence : sequences) {
    for (const bool with : {true, false}) {
      for (int run = 1; run <= arguments.runs; ++run)
        units.push_back(MakeUnit(arguments, sequence, with, run));
    }
  }
  RunConsole console(arguments.quiet || arguments.jobs > 1);
  const std::vector<UnitOutcome> outcomes = RunUnits(out, units, arguments.jobs, &console);

  std::vector<SequenceRuns> all;
  for (size_t i = 0; i < sequences.size(); ++i) {
    SequenceRuns runs{sequences[i], {}, {}};
    for (int k = 0; k < arguments.runs; ++k) {
      const size_t first = 2 * i * static_cast<size_t>(arguments.runs) + static_cast<size_t>(k);
      runs.with.push_back(&outcomes[first]);
      runs.without.push_back(&outcomes[first + static_cast<size_t>(arguments.runs)]);
    }
    all.push_back(std::move(runs));
  }
  std::vector<Table> tables = MakeTables(all, arguments);
  const Table runs = MakeRunTable(units, outcomes);
  const char* name = arguments.is_kitti ? "KITTI odometry" : "TUM RGB-D";
  ReportPage page{.title = fmt::format("{}: the paper's tables", name),
                  .subtitle = fmt::format("{} · detector {} · {} runs · version {}", arguments.root,
                                          arguments.detector, arguments.runs, DYNAMIC_SLAM_VERSION),
                  .times_s = {}};
  page.sections.push_back(ErrorBars(all, arguments));
  for (const Table& table : tables) page.sections.push_back(TableSection(table));
  std::vector<std::string> folders;
  for (size_t i = 0; i < units.size(); ++i)
    folders.push_back(outcomes[i].figures.has_value() ? units[i].folder : "");
  page.sections.push_back(RunSection(runs, folders));
  std::string note =
      missing.empty() ? "" : fmt::format("Not there, and skipped: {}.", fmt::join(missing, ", "));
  page.sections.back()["note"] = note;
  tables.push_back(runs);
  WriteTables(out, tables, page);
  PrintEnd(out, units, outcomes);
  if (console.ShouldStop()) *exit_code = kExitInterrupted;
}

void AddPaperCommand(CLI::App* bench, int* exit_code, bool is_kitti) {
  CLI::App* command = bench->add_subcommand(
      is_kitti ? "kitti" : "tum", is_kitti ? "Tables 5 to 7 of the paper, on KITTI's odometry sequences"
                                           : "Tables 1 to 4 of the paper, on TUM's dynamic sequences");
  const auto arguments = std::make_shared<PaperArguments>();
  PaperArguments& a = *arguments;
  a.is_kitti = is_kitti;
  a.detector = "yolox_nano";
  a.out = is_kitti ? "out/bench_kitti" : "out/bench_tum";
  command
      ->add_option(
          "--root", a.root,
          is_kitti ? "Folder with sequences/NN and poses/NN.txt" : "Folder with the sequences' folders")
      ->required();
  command
      ->add_option("--sequences", a.sequences,
                   "These only (default: the paper's; where none of them is there, all)")
      ->delimiter(',');
  AddRunsOption(command, &a.runs);
  AddJobsOption(command, &a.jobs);
  command->add_option("--camera", a.camera, "As of run (default: by the sequence's name)");
  AddRunOptions(command, "tables.txt, .csv, .json, report.html, and below it the results of each run", &a);
  AddSourceOptions(command, &a.source_options);
  command->footer(
      "Runs with the semantic part and without it, and prints the published figures beside ours. What is "
      "done\n"
      "is not done again: the same command goes on after an interrupt.\n"
      "Example:\n"
      "  dynamic_slam bench tum --root ~/tum --sequences fr3_walking_xyz,fr3_walking_rpy --detector "
      "yolox_nano");
  command->callback([arguments, exit_code] { RunPaper(*arguments, exit_code); });
}

}  // namespace

void AddPaperCommands(CLI::App* bench, int* exit_code) {
  AddPaperCommand(bench, exit_code, false);
  AddPaperCommand(bench, exit_code, true);
}

}  // namespace dynamic_slam
