#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

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

// Runs the units, so many at a time, as far as they are not done already: figures.json in a unit's folder,
// which is written last, holds what it was made of, and is as good as a run when that is the same. Each
// folder gets the results of a run, with report.html. An interrupt ends it; what was done stays.
std::vector<UnitOutcome> RunUnits(const std::filesystem::path& out, const std::vector<BenchUnit>& units,
                                  int jobs, RunConsole* console);

// The number at a path such as {"keyframe_errors", "ape", "rmse"} of the figures of each outcome that has it.
std::vector<double> FiguresAt(const std::vector<const UnitOutcome*>& outcomes,
                              const std::vector<std::string>& path);

// Of the middle two, when they are even in number; nothing of none.
std::optional<double> Median(std::vector<double> values);
std::optional<double> Mean(const std::vector<double>& values);

}  // namespace dynamic_slam
