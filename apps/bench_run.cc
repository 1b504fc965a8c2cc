#include "bench_run.h"

#include <cctype>
#include <exception>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "source_arguments.h"
#include "unmatched_inputs.h"

namespace dynamic_slam {
void AddRunOptions(CLI::App* command, const std::string& results, BenchArguments* arguments) {
  BenchArguments& a = *arguments;
  command
      ->add_option("--detector", a.detector,
                   "As of run; {source} in it stands for the sequence: boxes:{source}/boxes.csv")
      ->capture_default_str();
  command->add_option("--models", a.models, "Folder in which network files are looked for too");
  command->add_option("--config", a.config, "YAML file with options, or a profile: " + ProfileHelp());
  command->add_option("--set", a.assignments, "One option, key=value; may be repeated")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);  // else it takes SOURCE
  command->add_option("--out", a.out, fmt::format("Folder for {}", results))->capture_default_str();
  command->add_flag("--quiet", a.quiet, "No progress");
}

void AddBenchOptions(CLI::App* command, const std::string& results, BenchArguments* arguments) {
  command->add_option("SOURCE", arguments->sources, "Sequences, as of run")->required();
  command->add_option("--camera", arguments->camera, "As of run");
  AddRunOptions(command, results, arguments);
  AddSourceOptions(command, &arguments->source_options);
}

void ApplyArguments(const BenchArguments& arguments, SystemOptions* options) {
  if (!arguments.config.empty()) LoadProfile(arguments.config, options);
  ApplySet(options, arguments.assignments);
}

std::string DetectorFor(const BenchArguments& arguments, const std::string& source) {
  std::string name = arguments.detector;
  const std::string key = "{source}";
  const size_t at = name.find(key);
  return at == std::string::npos ? name : name.replace(at, key.size(), source);
}

void CheckInputs(const BenchArguments& arguments, const std::string& source) {
  ChooseCamera(arguments.camera, source, *OpenFrameSource(source, arguments.source_options));
  MakeDetector(DetectorFor(arguments, source), arguments.models);
}

BenchRun RunForBench(const BenchArguments& arguments, const std::string& source_name,
                     const std::vector<std::string>& assignments, RunConsole* console,
                     const std::function<void(const RunProgress&)>& on_frame) {
  SystemOptions options;
  ApplyArguments(arguments, &options);
  ApplySet(&options, assignments);
  const std::unique_ptr<FrameSource> source = OpenFrameSource(source_name, arguments.source_options);
  BenchRun run;
  const Camera camera = ChooseCamera(arguments.camera, source_name, *source);
  run.system = std::make_unique<SlamSystem>(camera, options);
  RunRecorder recorder(source_name, camera, options.image);
  const std::string detector = DetectorFor(arguments, source_name);
  run.system->SetDetector(recorder.Record(MakeDetector(detector, arguments.models)));
  UnmatchedInputs unmatched(detector, std::nullopt, *console);
  RunControl control = console->Control();
  control.on_frame = [&](const RunProgress& progress) {
    console->Show(progress);
    recorder.Watch(progress);
    unmatched.Watch(*progress.image);
    if (on_frame) on_frame(progress);
  };
  run.summary = RunSequence(*source, *run.system, control);
  run.summary.source = source_name;
  console->End();
  unmatched.Finish();
  if (run.summary.failure != nullptr) std::rethrow_exception(run.summary.failure);
  run.record = recorder.Finish(run.summary, LoadGroundTruth(source_name));
  return run;
}

std::string ShortName(const std::string& source) {
  std::filesystem::path path = std::filesystem::path(source).lexically_normal();
  if (path.filename().empty()) path = path.parent_path();
  return path.filename().string();
}

void WriteCsv(const std::filesystem::path& file, const nlohmann::ordered_json& rows) {
  std::string csv;
  for (const nlohmann::ordered_json& row : rows) {
    std::string keys, values;
    for (const auto& [key, value] : row.items()) {
      if (!keys.empty()) {
        keys += ",";
        values += ",";
      }
      keys += key;
      values += value.is_null() ? "" : value.is_string() ? value.get<std::string>() : value.dump();
    }
    if (csv.empty()) csv = keys + "\n";
    csv += values + "\n";
  }
  WriteFileAtomically(file, csv);
}

void WriteJson(const std::filesystem::path& file, const nlohmann::ordered_json& json) {
  WriteFileAtomically(file, json.dump(2) + "\n");
}

void WriteRows(const std::filesystem::path& folder, const std::string& name,
               const nlohmann::ordered_json& rows) {
  WriteCsv(folder / (name + ".csv"), rows);
  WriteJson(folder / (name + ".json"), rows);
}

void WriteTables(const std::filesystem::path& folder, const std::vector<Table>& tables,
                 const ReportPage& page) {
  std::string text;
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const Table& table : tables) {
    text += "\n" + TerminalText(table);
    json.push_back(TableJson(table));
    std::string name = table.title.substr(0, table.title.find(':'));
    for (char& c : name) c = c == ' ' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    std::erase(name, ',');
    WriteFileAtomically(folder / (name + ".csv"), CsvText(table));
  }
  fmt::print("{}\n", text);
  WriteFileAtomically(folder / "tables.txt", text);
  WriteJson(folder / "tables.json", json);
  WritePage(folder / "report.html", page);
}

void WriteBenchReport(const std::filesystem::path& folder, const std::string& title,
                      const BenchArguments& arguments, const nlohmann::ordered_json& rows,
                      const std::vector<CurvePlot>& plots) {
  ReportPage page{
      .title = title,
      .subtitle = fmt::format("detector {} · version {}", arguments.detector, DYNAMIC_SLAM_VERSION),
      .times_s = {}};
  if (!rows.empty()) page.sections.push_back(TableSection(TableOfRows("Results", rows)));
  if (!plots.empty()) page.sections.push_back(CurvesSection("Curves", plots));
  WritePage(folder / "report.html", page);
}

void WriteCurves(const std::filesystem::path& folder, const std::string& name, const CurvePlot& plot) {
  constexpr int kWidthPx = 700, kHeightPx = 480;
  WritePicture((folder / (name + ".png")).string(), DrawCurves(plot, kWidthPx, kHeightPx));
}

const cv::Scalar& CurveColour(size_t index) {
  static const cv::Scalar kColours[] = {kEstimateColour, {60, 60, 200}, {90, 150, 40}, {170, 60, 150}, kInk};
  return kColours[index % std::size(kColours)];
}

}  // namespace dynamic_slam
