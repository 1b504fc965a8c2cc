// How well places are known again by what they look like, before geometry is asked, and what closing loops is
// worth.

#include <algorithm>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "bench_run.h"
#include "cmd_bench.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/eval/place_recognition.h"
#include "dynamic_slam/features/place_index.h"
#include "truth_report.h"

namespace dynamic_slam {
namespace {

// Two cameras are at one place when they are nearer than a quarter of the depth that they see and turned by
// less than this: then they see much the same. What is known again may be farther, up to the depth itself;
// it is wrong when it is out of sight. Between these it may be either.
constexpr double kSameDepths = 0.25, kRightDepths = 1, kWrongDepths = 3;
constexpr double kSameDeg = 25, kRightDeg = 45, kWrongDeg = 60;

constexpr double kMaxDifferenceS = 0.01;  // between a keyframe's stamp and that of its true pose

struct LoopsArguments : BenchArguments {
  double apart_s = 10;
};

struct Outcome {
  std::string source, variant;
  double coverage = 0;
  std::optional<TruthComparison> truth;
  LoopReport loops;
  std::optional<int> false_loops;
  size_t places = 0;  // of the run without closing
  std::vector<PrecisionRecall> curve;
};

const StampedPose* PoseAt(const Trajectory& truth, double timestamp_s) {
  const auto after =
      std::lower_bound(truth.begin(), truth.end(), timestamp_s - kMaxDifferenceS,
                       [](const StampedPose& pose, double time_s) { return pose.timestamp_s < time_s; });
  return after != truth.end() && after->timestamp_s <= timestamp_s + kMaxDifferenceS ? &*after : nullptr;
}

// How far apart two cameras truly are.
struct Distance {
  double depths, deg;

  bool IsSame() const { return depths < kSameDepths && deg < kSameDeg; }
  PlaceAnswer::Truth Judge() const {
    if (depths < kRightDepths && deg < kRightDeg) return PlaceAnswer::Truth::kRight;
    return depths > kWrongDepths || deg > kWrongDeg ? PlaceAnswer::Truth::kWrong
                                                    : PlaceAnswer::Truth::kUnclear;
  }
};

Distance Between(const Rigid3& a, const Rigid3& b, double depth_m) {
  return {(a.translation - b.translation).norm() / depth_m,
          a.rotation.angularDistance(b.rotation) * 180 / std::numbers::pi};
}

// Of all that the map sees, m.
double TypicalDepth(const Map& map, double scale) {
  std::vector<double> depths;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    if (const double depth = map.MedianDepth(keyframe.id()); depth > 0) depths.push_back(scale * depth);
  });
  DS_CHECK(!depths.empty());
  std::nth_element(depths.begin(), depths.begin() + static_cast<long>(depths.size() / 2), depths.end());
  return depths[depths.size() / 2];
}

// Each keyframe asks which of those of at least `apart_s` before looks most like it.
std::vector<PlaceAnswer> AskPlaces(const Map& map, const Trajectory& truth, double depth_m, double apart_s) {
  struct View {
    const Keyframe* keyframe;
    Rigid3 world_from_cam;
  };
  std::vector<View> views;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    const StampedPose* pose = PoseAt(truth, keyframe.timestamp_s());
    if (pose != nullptr) views.push_back({&keyframe, pose->world_from_cam});
  });
  std::vector<PlaceAnswer> answers;
  PlaceIndex index;
  size_t known = 0;
  for (const View& view : views) {
    for (; views[known].keyframe->timestamp_s() + apart_s <= view.keyframe->timestamp_s(); ++known) {
      const KeyframeId id = views[known].keyframe->id();
      index.Add(id, map.places().WordsOf(id));
    }
    PlaceAnswer answer;
    for (size_t i = 0; i < known && !answer.has_place; ++i) {
      answer.has_place = Between(view.world_from_cam, views[i].world_from_cam, depth_m).IsSame();
    }
    const std::vector<PlaceMatch> matches = index.Query(map.places().WordsOf(view.keyframe->id()));
    if (!matches.empty()) {
      const auto found = std::find_if(views.begin(), views.end(), [&](const View& other) {
        return other.keyframe->id() == matches.front().keyframe;
      });
      answer.score = matches.front().score;
      answer.truth = Between(view.world_from_cam, found->world_from_cam, depth_m).Judge();
    }
    answers.push_back(answer);
  }
  return answers;
}

int CountFalseLoops(const LoopReport& loops, const Trajectory& truth, double depth_m) {
  return static_cast<int>(
      std::count_if(loops.attempts.begin(), loops.attempts.end(), [&](const LoopAttempt& attempt) {
        const StampedPose* pose = PoseAt(truth, attempt.timestamp_s);
        const StampedPose* other = PoseAt(truth, attempt.candidate_timestamp_s);
        return attempt.reason.empty() && pose != nullptr && other != nullptr &&
               Between(pose->world_from_cam, other->world_from_cam, depth_m).Judge() ==
                   PlaceAnswer::Truth::kWrong;
      }));
}

Outcome RunVariant(const LoopsArguments& arguments, const std::string& source, bool closing,
                   RunConsole* console) {
  const BenchRun run =
      RunForBench(arguments, source, {closing ? "loop.enabled=true" : "loop.enabled=false"}, console);
  Outcome outcome{source, closing ? "with" : "without", run.summary.Coverage(), {}, run.summary.loops, {}, 0,
                  {}};
  const std::optional<Trajectory>& truth = run.record.truth;
  const Trajectory estimate = run.system->FrameTrajectory();
  if (!truth.has_value() || estimate.size() < 3) return outcome;
  outcome.truth = CompareWithTruth(*truth, estimate);
  const auto map = run.system->map().Read();
  const double depth_m = TypicalDepth(*map, outcome.truth->ape.reference_from_estimate.scale);
  if (closing) {
    outcome.false_loops = CountFalseLoops(outcome.loops, *truth, depth_m);
  } else {
    const std::vector<PlaceAnswer> answers = AskPlaces(*map, *truth, depth_m, arguments.apart_s);
    outcome.curve = PrecisionRecallCurve(answers);
    outcome.places = static_cast<size_t>(
        std::count_if(answers.begin(), answers.end(), [](const PlaceAnswer& a) { return a.has_place; }));
  }
  return outcome;
}

nlohmann::ordered_json ToRow(const Outcome& outcome) {
  nlohmann::ordered_json row = {{"source", outcome.source},
                                {"closing", outcome.variant},
                                {"coverage", outcome.coverage},
                                {"ape_m", nullptr},
                                {"path_m", nullptr},
                                {"corrected", outcome.loops.corrected},
                                {"linked", outcome.loops.linked},
                                {"false_loops", nullptr},
                                {"places_seen_again", nullptr},
                                {"recall_at_full_precision", nullptr}};
  if (outcome.truth.has_value()) {
    row["ape_m"] = outcome.truth->ape.translation_m.rmse;
    row["path_m"] = outcome.truth->path_m;
  }
  if (outcome.false_loops.has_value()) row["false_loops"] = *outcome.false_loops;
  if (!outcome.curve.empty()) {
    row["places_seen_again"] = outcome.places;
    row["recall_at_full_precision"] = RecallAtFullPrecision(outcome.curve);
  }
  return row;
}

void Print(const std::vector<Outcome>& outcomes) {
  fmt::print("\n{:<24} {:<8} {:>8} {:>9} {:>7} {:>9} {:>6} {:>5} {:>19}\n", "source", "closing", "coverage",
             "APE, m", "% path", "corrected", "linked", "false", "recall, precision 1");
  for (const Outcome& outcome : outcomes) {
    std::string ape = "-", share = "-", recall = "-";
    if (outcome.truth.has_value()) {
      const double rmse = outcome.truth->ape.translation_m.rmse;
      ape = fmt::format("{:.3f}", rmse);
      share = fmt::format("{:.2f}", 100 * rmse / outcome.truth->path_m);
    }
    if (!outcome.curve.empty()) {
      recall = fmt::format("{:.2f} of {}", RecallAtFullPrecision(outcome.curve), outcome.places);
    }
    fmt::print("{:<24} {:<8} {:>8.3f} {:>9} {:>7} {:>9} {:>6} {:>5} {:>19}\n", ShortName(outcome.source),
               outcome.variant, outcome.coverage, ape, share, outcome.loops.corrected, outcome.loops.linked,
               outcome.false_loops.has_value() ? std::to_string(*outcome.false_loops) : "-", recall);
  }
}

void WriteOutcomes(const LoopsArguments& arguments, const std::vector<Outcome>& outcomes) {
  const std::filesystem::path folder = arguments.out;
  nlohmann::ordered_json rows = nlohmann::ordered_json::array(), points = nlohmann::ordered_json::array();
  CurvePlot plot{"Places known again, before geometry is asked", "recall", "precision", {}, 1, 1};
  for (const Outcome& outcome : outcomes) {
    rows.push_back(ToRow(outcome));
    if (outcome.curve.empty()) continue;
    CurvePlot::Curve curve{ShortName(outcome.source), CurveColour(plot.curves.size()), {}};
    for (const PrecisionRecall& point : outcome.curve) {
      curve.points.emplace_back(point.recall, point.precision);
      points.push_back({{"source", outcome.source},
                        {"min_score", point.min_score},
                        {"precision", point.precision},
                        {"recall", point.recall}});
    }
    plot.curves.push_back(std::move(curve));
  }
  WriteRows(folder, "loops", rows);
  WriteRows(folder, "places", points);
  WriteCurves(folder, "places", plot);
  WriteBenchReport(folder, "Loops", arguments, rows, {plot});
}

void RunLoops(const LoopsArguments& arguments, int* exit_code) {
  if (!arguments.out.empty()) PrepareOutputFolder(arguments.out);
  std::vector<Outcome> outcomes;
  RunConsole console(arguments.quiet);
  for (const std::string& source : arguments.sources) {
    for (const bool closing : {false, true}) {
      if (console.ShouldStop()) break;
      if (!arguments.quiet) fmt::print(stderr, "{}: {} closing\n", source, closing ? "with" : "without");
      Outcome outcome = RunVariant(arguments, source, closing, &console);
      if (!console.ShouldStop()) outcomes.push_back(std::move(outcome));
    }
  }
  Print(outcomes);
  if (!arguments.out.empty()) {
    WriteOutcomes(arguments, outcomes);
    fmt::print("results: {}\n", arguments.out);
  }
  if (console.ShouldStop()) *exit_code = kExitInterrupted;
}

}  // namespace

void AddLoopsCommand(CLI::App* bench, int* exit_code) {
  CLI::App* command = bench->add_subcommand(
      "loops", "How well places are known again, and what closing loops is worth: with it and without");
  const auto arguments = std::make_shared<LoopsArguments>();
  AddBenchOptions(command, "loops.csv, places.csv, the same as .json, and places.png", arguments.get());
  command->add_option("--apart-s", arguments->apart_s, "A place is seen again after so long at least, s")
      ->check(CLI::PositiveNumber);
  command->footer(
      "Recall: each keyframe of the run without closing asks which older one looks most like it. Two are at "
      "one\n"
      "place when they are nearer than a quarter of the depth that they see and turned by less than 25 deg; "
      "an\n"
      "answer is right within that depth and 45 deg, wrong beyond three times that depth or 60 deg.\n"
      "A loop is false by the same rule.\n"
      "Example:\n"
      "  dynamic_slam bench loops street corridor --detector boxes:{source}/boxes.csv --out loops");
  command->callback([arguments, exit_code] { RunLoops(*arguments, exit_code); });
}

}  // namespace dynamic_slam
