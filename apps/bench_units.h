#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

#include "bench_run.h"
#include "run_console.h"

namespace dynamic_slam {

// One run of a benchmark, whose results have a folder of their own.
struct BenchUnit {
  std::string folder;  // below that of the benchmark
  std::string title;   // of its report
  std::string source;
  BenchArguments arguments;
};

// What came of a unit: its figures, or why there are none. Neither: it was not begun.
struct UnitOutcome {
  std::optional<nlohmann::ordered_json> figures;
  std::string failure;
};

// How often each is run, and how many at a time.
void AddRunsOption(CLI::App* command, int* runs);
void AddJobsOption(CLI::App* command, int* jobs);

// Runs the units, so many at a time, as far as they are not done already: figures.json in a unit's folder,
// which is written last, holds what it was made of, and is as good as a run when that is the same. Each
// folder gets the results of a run, with report.html. An interrupt ends it; what was done stays. Throws
// InputError for options that do not exist, before the first run; what fails later is an outcome.
std::vector<UnitOutcome> RunUnits(const std::filesystem::path& out, const std::vector<BenchUnit>& units,
                                  int jobs, RunConsole* console);

// Names what failed, and where the results are.
void PrintEnd(const std::filesystem::path& out, const std::vector<BenchUnit>& units,
              const std::vector<UnitOutcome>& outcomes);

// A table of runs for a page: the first cell of each row leads to the report in its folder, which is below
// the page's. "": it has none.
nlohmann::ordered_json RunSection(const Table& table, const std::vector<std::string>& folders);

// The number at a path such as {"keyframe_errors", "ape", "rmse"} of the figures of an outcome.
std::optional<double> FigureAt(const UnitOutcome& outcome, const std::vector<std::string>& path);

// Of each outcome that has it.
std::vector<double> FiguresAt(const std::vector<const UnitOutcome*>& outcomes,
                              const std::vector<std::string>& path);

// Of the middle two, when they are even in number; nothing of none.
std::optional<double> Median(std::vector<double> values);
std::optional<double> Mean(const std::vector<double>& values);

}  // namespace dynamic_slam
