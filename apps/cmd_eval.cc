#include "cmd_eval.h"

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/eval/metrics.h"
#include "dynamic_slam/eval/pose_list.h"
#include "dynamic_slam/io/trajectory_file.h"

namespace dynamic_slam {
namespace {

struct EvalArguments {
  std::string metric, ground_truth, estimate, times;
  std::string format = "tum";
  std::string align = "sim3";
  std::string delta_unit = "frames";
  double max_dt_s = 0.01;
  double delta = 1;
  bool json = false;
};

const std::map<std::string, Alignment> kAlignments = {
    {"sim3", Alignment::kSim3}, {"se3", Alignment::kSe3}, {"none", Alignment::kNone}};

struct Match {
  size_t ground_truth_poses = 0, estimate_poses = 0;
  MatchedPoses poses;
};

Match ReadAndMatch(const EvalArguments& arguments) {
  const bool kitti = arguments.format == "kitti";
  if (!kitti && !arguments.times.empty()) {
    throw InputError("--times", "goes with --format kitti only", "TUM files have their own stamps.");
  }
  const bool by_row = kitti && arguments.times.empty();
  std::vector<double> times_s;
  if (!arguments.times.empty()) times_s = ReadTimes(arguments.times);
  const PoseList reference = kitti ? ToPoseList(ReadKittiMatrices(arguments.ground_truth), times_s)
                                   : ToPoseList(ReadTumTrajectory(arguments.ground_truth));
  const PoseList estimate = by_row ? ToPoseList(ReadKittiMatrices(arguments.estimate), {})
                                   : ToPoseList(ReadTumTrajectory(arguments.estimate));
  return {reference.size(), estimate.size(),
          by_row ? MatchByRow(reference, estimate) : MatchByTime(reference, estimate, arguments.max_dt_s)};
}

nlohmann::ordered_json ToJson(const ErrorStatistics& s) {
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.std},
          {"min", s.min},   {"max", s.max},   {"sse", s.sse},       {"n", s.n}};
}

void PrintJson(const EvalArguments& arguments, const Match& match, const TrajectoryErrors& errors) {
  // The translation part also stands at the top, where single-number readers look.
  nlohmann::ordered_json json = ToJson(errors.translation_m);
  json["scale"] = errors.reference_from_estimate.scale;
  json["metric"] = arguments.metric;
  json["align"] = arguments.align;
  if (arguments.metric == "rpe") {
    json["delta"] = arguments.delta;
    json["delta_unit"] = arguments.delta_unit;
  }
  json["ground_truth_poses"] = match.ground_truth_poses;
  json["estimate_poses"] = match.estimate_poses;
  json["matched_poses"] = match.poses.estimate.size();
  json["translation"] = ToJson(errors.translation_m);
  json["translation"]["unit"] = "m";
  json["rotation"] = ToJson(errors.rotation_deg);
  json["rotation"]["unit"] = "deg";
  fmt::print("{}\n", json.dump(2));
}

void PrintTable(const EvalArguments& arguments, const Match& match, const TrajectoryErrors& errors) {
  const ErrorStatistics &t = errors.translation_m, &r = errors.rotation_deg;
  if (arguments.metric == "ape") {
    fmt::print("Absolute pose error, alignment {}", arguments.align);
  } else {
    fmt::print("Relative pose error, alignment {}, delta {} {}", arguments.align, arguments.delta,
               arguments.delta_unit);
  }
  fmt::print("\n{} of {} estimated and {} true poses matched, {} errors, scale {:.6f}\n\n",
             match.poses.estimate.size(), match.estimate_poses, match.ground_truth_poses, t.n,
             errors.reference_from_estimate.scale);
  fmt::print("{:<8}{:>18}{:>18}\n", "", "translation [m]", "rotation [deg]");
  const auto row = [](const char* name, double translation, double rotation) {
    fmt::print("{:<8}{:>18.6f}{:>18.6f}\n", name, translation, rotation);
  };
  row("rmse", t.rmse, r.rmse);
  row("mean", t.mean, r.mean);
  row("median", t.median, r.median);
  row("std", t.std, r.std);
  row("min", t.min, r.min);
  row("max", t.max, r.max);
  row("sse", t.sse, r.sse);
}

void RunEval(const EvalArguments& arguments) {
  const Match match = ReadAndMatch(arguments);
  const Alignment alignment = kAlignments.at(arguments.align);
  const RpeOptions rpe{arguments.delta,
                       arguments.delta_unit == "m" ? DeltaUnit::kMetres : DeltaUnit::kFrames};
  const TrajectoryErrors errors = arguments.metric == "ape" ? AbsolutePoseError(match.poses, alignment)
                                                            : RelativePoseError(match.poses, alignment, rpe);
  arguments.json ? PrintJson(arguments, match, errors) : PrintTable(arguments, match, errors);
}

}  // namespace

void AddEvalCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand("eval", "Judge a trajectory against ground truth, as evo does");
  const auto arguments = std::make_shared<EvalArguments>();
  EvalArguments& a = *arguments;
  command->add_option("METRIC", a.metric, "ape: absolute pose error; rpe: relative pose error")
      ->required()
      ->check(CLI::IsMember({"ape", "rpe"}));
  command->add_option("GT", a.ground_truth, "Ground truth file")->required();
  command->add_option("EST", a.estimate, "Estimated trajectory file")->required();
  command->add_option("--format", a.format, "Layout of the files: tum, or kitti (rows matched one by one)")
      ->check(CLI::IsMember({"tum", "kitti"}))
      ->capture_default_str();
  command->add_option(
      "--times", a.times,
      "With --format kitti: times.txt with a stamp for each row of GT; EST is then a TUM file");
  command->add_option("--align", a.align, "How EST is moved onto GT first: sim3 (with scale), se3, none")
      ->check(CLI::IsMember({"sim3", "se3", "none"}))
      ->capture_default_str();
  command->add_option("--max-dt", a.max_dt_s, "Largest difference of the stamps of two matched poses, s")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--delta", a.delta, "rpe: distance of the poses of a pair")->capture_default_str();
  command->add_option("--delta-unit", a.delta_unit, "rpe: unit of --delta: frames, or m along EST")
      ->check(CLI::IsMember({"frames", "m"}))
      ->capture_default_str();
  command->add_flag("--json", a.json, "Print one JSON object with all digits");
  command->footer(
      "Examples:\n"
      "  dynamic_slam eval ape groundtruth.txt out/trajectory.txt\n"
      "  dynamic_slam eval rpe poses/00.txt out/trajectory.txt --format kitti --times sequences/00/times.txt "
      "--delta 100 --delta-unit m");
  command->callback([arguments] { RunEval(*arguments); });
}

}  // namespace dynamic_slam
