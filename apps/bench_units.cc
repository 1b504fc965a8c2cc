#include "bench_units.h"

#include <algorithm>
#include <memory>
#include <numeric>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/guarded.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/base/worker.h"
#include "dynamic_slam/eval/metrics.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/report/truth_comparison.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Json ToJson(const ErrorStatistics& s) {
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.std}, {"n", s.n}};
}

// Of the poses in a file, as evo has them; null where too few poses match for an alignment or a motion.
Json ErrorsOfFile(const fs::path& file, const Trajectory& truth) {
  const auto attempt = [](const auto& function) -> Json {
    try {
      return function();
    } catch (const InputError&) {
      return nullptr;
    }
  };
  return attempt([&]() -> Json {
    const MatchedPoses poses =
        MatchByTime(ToPoseList(truth), ToPoseList(ReadTumTrajectory(file)), kMaxTruthDifferenceS);
    const TrajectoryErrors ape = AbsolutePoseError(poses, Alignment::kSim3);
    Json json = {{"ape", ToJson(ape.translation_m)},
                 {"scale", ape.reference_from_estimate.scale},
                 {"path_m", PathLength(poses.reference)}};
    json["rpe_translation"] = attempt(
        [&]() -> Json { return ToJson(RelativePoseError(poses, Alignment::kSim3, {}).translation_m); });
    json["rpe_rotation"] = attempt(
        [&]() -> Json { return ToJson(RelativePoseError(poses, Alignment::kSim3, {}).rotation_deg); });
    json["rpe_rotation_per_m"] = attempt([&]() -> Json {
      return ToJson(RelativePoseError(poses, Alignment::kSim3, {1, DeltaUnit::kMetres}).rotation_deg);
    });
    return json;
  });
}

// How far the truth reaches along each axis, m.
Json DimensionsOf(const Trajectory& truth) {
  Eigen::Vector3d low = truth.front().world_from_cam.translation, high = low;
  for (const StampedPose& pose : truth) {
    low = low.cwiseMin(pose.world_from_cam.translation);
    high = high.cwiseMax(pose.world_from_cam.translation);
  }
  return {high.x() - low.x(), high.y() - low.y(), high.z() - low.z()};
}

// All that decides what a unit's figures are.
Json MadeOf(const BenchUnit& unit) {
  SystemOptions options;
  const BenchArguments& a = unit.arguments;
  ApplyArguments(a, &options);
  return {{"source", fs::weakly_canonical(unit.source).string()},
          {"camera", a.camera},
          {"detector", a.detector},
          {"start", a.source_options.start},
          {"max_frames", a.source_options.max_frames},
          {"version", DYNAMIC_SLAM_VERSION},
          {"options", OptionsToYaml(options)}};
}

Json Measure(const BenchRun& run, const fs::path& folder) {
  const RunSummary& s = run.summary;
  Json json = {{"frames_total", s.frames_total},
               {"coverage_live", s.Coverage()},
               {"coverage_backfilled", s.frames_total == 0
                                           ? 0.0
                                           : static_cast<double>(s.frames_tracked + s.frames_backfilled) /
                                                 static_cast<double>(s.frames_total)},
               {"keyframes", s.keyframes},
               {"lost", s.lost_count},
               {"tracking_median_s", s.tracking_ms.median / 1000},
               {"tracking_mean_s", s.tracking_ms.mean / 1000}};
  double total_ms = 0;
  for (const RunSummary::FrameRecord& frame : s.frames) total_ms += frame.tracking_ms;
  json["tracking_total_s"] = total_ms / 1000;
  json["detection_mean_s"] = nullptr;
  if (s.detection.has_value()) json["detection_mean_s"] = SummariseTimes(s.detection->times_ms).mean / 1000;
  json["dimensions_m"] = nullptr;
  json["keyframe_errors"] = nullptr;
  json["frame_errors"] = nullptr;
  if (run.record.truth.has_value() && !run.record.truth->empty()) {
    json["dimensions_m"] = DimensionsOf(*run.record.truth);
    // Of the files, so that anybody gets the same numbers from them.
    json["keyframe_errors"] = ErrorsOfFile(folder / "keyframes.txt", *run.record.truth);
    json["frame_errors"] = ErrorsOfFile(folder / "trajectory.txt", *run.record.truth);
  }
  return json;
}

std::optional<Json> Done(const fs::path& file, const Json& made_of) {
  if (!fs::is_regular_file(file)) return std::nullopt;
  const Json known = Json::parse(ReadFile(file), nullptr, false);
  if (known.is_discarded() || !known.contains("made_of") || known["made_of"] != made_of) return std::nullopt;
  return known["figures"];
}

UnitOutcome RunUnit(const fs::path& out, const BenchUnit& unit, const Json& made_of, RunConsole* console) {
  const fs::path folder = out / unit.folder;
  try {
    if (std::optional<Json> figures = Done(folder / "figures.json", made_of)) {
      fmt::print(stderr, "{}: done before\n", unit.folder);
      return {std::move(figures), ""};
    }
    fmt::print(stderr, "{}\n", unit.folder);
    const BenchRun run = RunForBench(unit.arguments, unit.source, {}, console);
    if (run.summary.interrupted) return {};
    WriteResults(folder, *run.system, run.summary);
    WriteRunReport(folder, unit.title, *run.system, run.summary, run.record);
    Json figures = Measure(run, folder);
    WriteJson(folder / "figures.json", {{"made_of", made_of}, {"figures", figures}});
    return {std::move(figures), ""};
  } catch (const InputError& error) {
    fmt::print(stderr, "{}: {}\n", unit.folder, error.what());
    return {std::nullopt, error.what()};
  }
}

}  // namespace

void AddRunsOption(CLI::App* command, int* runs) {
  command->add_option("--runs", *runs, "Runs of each, each with a seed of its own")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
}

void AddJobsOption(CLI::App* command, int* jobs) {
  command->add_option("--jobs", *jobs, "Runs at a time; times are those of a busy machine then")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
}

std::vector<UnitOutcome> RunUnits(const fs::path& out, const std::vector<BenchUnit>& units, int jobs,
                                  RunConsole* console) {
  std::vector<Json> made_of;
  for (const BenchUnit& unit : units) made_of.push_back(MadeOf(unit));
  std::vector<UnitOutcome> outcomes(units.size());
  Guarded<size_t> next(0);
  const auto work = [&] {
    while (!console->ShouldStop()) {
      const size_t unit = (*next.Write())++;
      if (unit >= units.size()) return;
      outcomes[unit] = RunUnit(out, units[unit], made_of[unit], console);
    }
  };
  if (jobs == 1) {
    work();
    return outcomes;
  }
  std::vector<std::unique_ptr<Worker>> workers;
  for (int i = 0; i < jobs; ++i) {
    workers.push_back(std::make_unique<Worker>(TraceName("bench")));
    workers.back()->Post([&work](const std::stop_token&) { work(); });
  }
  for (const auto& worker : workers) worker->Drain();
  return outcomes;
}

void PrintEnd(const fs::path& out, const std::vector<BenchUnit>& units,
              const std::vector<UnitOutcome>& outcomes) {
  for (size_t i = 0; i < units.size(); ++i) {
    if (!outcomes[i].failure.empty()) fmt::print("failed: {}: {}\n", units[i].folder, outcomes[i].failure);
  }
  fmt::print("results: {}, report: {}\n", out.string(), (out / "report.html").string());
}

Json RunSection(const Table& table, const std::vector<std::string>& folders) {
  Json section = TableSection(table);
  for (size_t i = 0; i < folders.size(); ++i) {
    if (folders[i].empty()) continue;
    section["rows"][i][0] = {{"text", table.rows[i][0]}, {"href", folders[i] + "/report.html"}};
  }
  return section;
}

std::optional<double> FigureAt(const UnitOutcome& outcome, const std::vector<std::string>& path) {
  if (!outcome.figures.has_value()) return std::nullopt;
  const Json* at = &*outcome.figures;
  for (const std::string& key : path) {
    at = at != nullptr && at->is_object() && at->contains(key) ? &(*at)[key] : nullptr;
  }
  if (at == nullptr || !at->is_number()) return std::nullopt;
  return at->get<double>();
}

std::vector<double> FiguresAt(const std::vector<const UnitOutcome*>& outcomes,
                              const std::vector<std::string>& path) {
  std::vector<double> values;
  for (const UnitOutcome* outcome : outcomes) {
    if (const std::optional<double> value = FigureAt(*outcome, path)) values.push_back(*value);
  }
  return values;
}

std::optional<double> Median(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  return Summarise(std::move(values)).median;
}

std::optional<double> Mean(const std::vector<double>& values) {
  if (values.empty()) return std::nullopt;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace dynamic_slam
