#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

#include "dynamic_slam/eval/curve_plot.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/report/report_page.h"
#include "dynamic_slam/report/table.h"
#include "dynamic_slam/system/sequence_runner.h"
#include "run_console.h"
#include "run_recorder.h"

namespace dynamic_slam {

// What all experiments take.
struct BenchArguments {
  std::vector<std::string> sources;
  std::string camera, detector = "none", models, out, config;
  std::vector<std::string> assignments;
  FrameSourceOptions source_options;
  bool quiet = false;
};

// Adds the options of a run to the command; `results` are the files that --out takes.
void AddRunOptions(CLI::App* command, const std::string& results, BenchArguments* arguments);

// The same with the sequences.
void AddBenchOptions(CLI::App* command, const std::string& results, BenchArguments* arguments);

// The arguments' detector for one source: `{source}` in its name stands for the source's folder, so that each
// may have its own boxes.
std::string DetectorFor(const BenchArguments& arguments, const std::string& source);

// Throws InputError where the source, its camera or the detector is not there.
void CheckInputs(const BenchArguments& arguments, const std::string& source);

struct BenchRun {
  std::unique_ptr<SlamSystem> system;
  RunSummary summary;
  RunRecord record;
};

// The options that the arguments' --config and --set give. Throws InputError.
void ApplyArguments(const BenchArguments& arguments, SystemOptions* options);

// Runs the source with these assignments after those of the arguments. `on_frame` may be empty. What a stage
// throws is thrown here.
BenchRun RunForBench(const BenchArguments& arguments, const std::string& source,
                     const std::vector<std::string>& assignments, RunConsole* console,
                     const std::function<void(const RunProgress&)>& on_frame = {});

// "street" of "data/street/".
std::string ShortName(const std::string& source);

// Flat objects with the same keys as rows; null is an empty cell.
void WriteCsv(const std::filesystem::path& file, const nlohmann::ordered_json& rows);
void WriteJson(const std::filesystem::path& file, const nlohmann::ordered_json& json);

// The same rows, flat objects with the same keys, as NAME.csv and NAME.json.
void WriteRows(const std::filesystem::path& folder, const std::string& name,
               const nlohmann::ordered_json& rows);

// Prints the tables; writes tables.txt, tables.json, each table as CSV, and the page as report.html.
void WriteTables(const std::filesystem::path& folder, const std::vector<Table>& tables,
                 const ReportPage& page);

// Of an experiment: its rows, if it has some, and its curves, as report.html.
void WriteBenchReport(const std::filesystem::path& folder, const std::string& title,
                      const BenchArguments& arguments, const nlohmann::ordered_json& rows,
                      const std::vector<CurvePlot>& plots);

// Into NAME.png.
void WriteCurves(const std::filesystem::path& folder, const std::string& name, const CurvePlot& plot);

// A colour for each of a few curves.
const cv::Scalar& CurveColour(size_t index);

}  // namespace dynamic_slam
