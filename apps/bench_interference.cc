#include <algorithm>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "cmd_bench.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/sim/simulation.h"
#include "experiment.h"
#include "mask_folder.h"
#include "render_sequence.h"
#include "run_console.h"

namespace dynamic_slam {
namespace {

// Section 4.2: mean numbers of keypoints of a keyframe.
constexpr double kPaperKeypoints = 3090, kPaperDynamic = 2290, kPaperStatic = 809,
                 kPaperDynamicShare = 0.7411;

constexpr double kRampS = 0.6;         // in which the camera comes to a stop (sim/camera_motion)
constexpr double kSpeedWindowS = 0.5;  // a speed is a displacement over so long

struct InterferenceArguments : BenchArguments {
  std::string scene = "crowd";
  int seeds = 5;
  int frames = 0;  // 0: the scene's
};

// Keypoints of a frame by the true mask, and the matches that hold its pose.
struct KeypointCounts {
  double timestamp_s = 0;
  int dynamic = 0, still = 0;
  int holding_dynamic = 0, holding_still = 0;
  int culled = 0;  // by Dynamic-SLAM
};

struct Run {
  ExperimentRun run;
  std::vector<KeypointCounts> counts;
  std::vector<Eigen::Vector2d> speeds;      // time (s), m/s
  double stop_speed = 0, moving_speed = 0;  // means, m/s

  double DynamicShare() const {
    double sum = 0;
    for (const KeypointCounts& c : counts) sum += c.dynamic / std::max(1.0, 1.0 * c.dynamic + c.still);
    return counts.empty() ? 0 : sum / static_cast<double>(counts.size());
  }
};

KeypointCounts Count(const RunProgress& progress, const cv::Mat& mask) {
  KeypointCounts counts{.timestamp_s = progress.image->timestamp_s};
  const Frame& frame = *progress.frame_in_work;
  const bool has_pose = progress.result->tracking.state == TrackingState::kTracking;
  for (size_t i = 0; i < frame.features.size(); ++i) {
    const Keypoint& keypoint = frame.features.keypoints[i];
    const bool is_dynamic = mask.at<uint8_t>(static_cast<int>(keypoint.raw_y + 0.5f),
                                             static_cast<int>(keypoint.raw_x + 0.5f)) != 0;
    ++(is_dynamic ? counts.dynamic : counts.still);
    if (!has_pose || !frame.landmarks[i].IsValid()) continue;
    if (TrustInMatch(frame.StaticProbability(i), frame.static_log_odds[i]) < kMinStaticProbability) continue;
    ++(is_dynamic ? counts.holding_dynamic : counts.holding_still);
  }
  counts.culled = progress.result->tracking.dynamic.culled;
  return counts;
}

std::vector<Eigen::Vector2d> Speeds(const Trajectory& path, double scale) {
  std::vector<Eigen::Vector2d> speeds;
  size_t from = 0;
  for (const StampedPose& pose : path) {
    while (pose.timestamp_s - path[from].timestamp_s > kSpeedWindowS + 1e-6) ++from;
    const double dt_s = pose.timestamp_s - path[from].timestamp_s;
    if (dt_s < 0.9 * kSpeedWindowS) continue;
    const double moved_m =
        scale * (pose.world_from_cam.translation - path[from].world_from_cam.translation).norm();
    speeds.emplace_back(pose.timestamp_s - 0.5 * dt_s, moved_m / dt_s);
  }
  return speeds;
}

double MeanSpeed(const std::vector<Eigen::Vector2d>& speeds, const CameraOptions& camera, bool in_stop) {
  double sum = 0;
  int count = 0;
  for (const Eigen::Vector2d& speed : speeds) {
    const double from = speed.x() - kSpeedWindowS / 2, to = speed.x() + kSpeedWindowS / 2;
    const bool rests = from >= camera.stop_at_s + kRampS && to <= camera.stop_at_s + camera.stop_s;
    const bool moves = to <= camera.stop_at_s || from >= camera.stop_at_s + camera.stop_s + kRampS;
    if (in_stop ? !rests : !moves) continue;
    sum += speed.y();
    ++count;
  }
  return count == 0 ? 0 : sum / count;
}

Run RunOnce(const BenchArguments& arguments, const std::filesystem::path& sequence, const Simulation& scene,
            RunConsole* console) {
  Run result;
  const MaskFolder masks(sequence / "masks", cv::Size(scene.camera().width, scene.camera().height));
  result.run = RunExperiment(arguments, sequence.string(), console, [&](const RunProgress& progress) {
    result.counts.push_back(Count(progress, masks.Read(*progress.image)));
  });
  if (!result.run.truth.has_value()) return result;
  result.speeds = Speeds(result.run.trajectory, result.run.truth->ape.reference_from_estimate.scale);
  result.stop_speed = MeanSpeed(result.speeds, scene.options().camera, true);
  result.moving_speed = MeanSpeed(result.speeds, scene.options().camera, false);
  return result;
}

// Upright lines where the camera stops and goes on.
CurvePlot::Curve StopLines(const CameraOptions& camera, double height) {
  CurvePlot::Curve stop{"the camera rests", kFaintInk, {}, 1};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double at_s : {camera.stop_at_s + kRampS, camera.stop_at_s + camera.stop_s}) {
    stop.points.insert(stop.points.end(), {{at_s, 0}, {at_s, height}, {nan, nan}});
  }
  return stop;
}

CurvePlot PlotCounts(const Run& with, const CameraOptions& camera) {
  CurvePlot plot{fmt::format("Keypoints: {:.0f}% on people (the paper's Fig. 9: {:.0f}%)",
                             100 * with.DynamicShare(), 100 * kPaperDynamicShare),
                 "time [s]",
                 "keypoints",
                 {}};
  CurvePlot::Curve dynamic{"on people", kWithoutColour, {}, 1.5}, still{"at rest", kEstimateColour, {}, 1.5},
      wrong{"on people and holding the pose", kInk, {}, 1.5};
  for (const KeypointCounts& count : with.counts) {
    dynamic.points.emplace_back(count.timestamp_s, count.dynamic);
    still.points.emplace_back(count.timestamp_s, count.still);
    wrong.points.emplace_back(count.timestamp_s, count.holding_dynamic);
    plot.y_max = std::max<double>({plot.y_max, 1.05 * count.dynamic, 1.05 * count.still});
  }
  plot.curves = {StopLines(camera, plot.y_max), dynamic, still, wrong};
  return plot;
}

CurvePlot PlotSpeeds(const Trajectory& truth, const Run& with, const Run& without,
                     const CameraOptions& camera) {
  CurvePlot plot{"Speed of the camera: a stop shows as a stop", "time [s]", "m/s", {}};
  plot.curves = {{"truth", kTruthColour, Speeds(truth, 1), 5},
                 {"without semantics", kWithoutColour, without.speeds, 1.5},
                 {"with", kEstimateColour, with.speeds, 1.5}};
  for (const CurvePlot::Curve& curve : plot.curves) {
    for (const Eigen::Vector2d& speed : curve.points) plot.y_max = std::max(plot.y_max, 1.05 * speed.y());
  }
  plot.curves.insert(plot.curves.begin(), StopLines(camera, plot.y_max));
  return plot;
}

cv::Mat DrawInterference(const Trajectory& truth, const Run& with, const Run& without,
                         const CameraOptions& camera) {
  constexpr double kChartWidthPx = 720, kChartHeightPx = 330, kPathWidthPx = 620;
  Canvas canvas(static_cast<int>(kChartWidthPx + kPathWidthPx), static_cast<int>(2 * kChartHeightPx));
  DrawCurves(PlotCounts(with, camera), {0, 0}, kChartWidthPx, kChartHeightPx, &canvas);
  DrawCurves(PlotSpeeds(truth, with, without, camera), {0, kChartHeightPx}, kChartWidthPx, kChartHeightPx,
             &canvas);
  TrajectoryPlot paths = PlotBoth(truth, with.run, without.run);
  paths.title = fmt::format("Error {} of the path, without semantics {}", Percent(with.run.ErrorShare()),
                            Percent(without.run.ErrorShare()));
  DrawPlot(paths, {kChartWidthPx, 0}, kPathWidthPx, 2 * kChartHeightPx, &canvas);
  return canvas.Finish();
}

nlohmann::ordered_json Row(uint64_t seed, bool semantics, const Run& run) {
  double dynamic = 0, still = 0, holding_dynamic = 0, holding_still = 0;
  const double n = std::max<double>(1, static_cast<double>(run.counts.size()));
  for (const KeypointCounts& count : run.counts) {
    dynamic += count.dynamic / n;
    still += count.still / n;
    holding_dynamic += count.holding_dynamic / n;
    holding_still += count.holding_still / n;
  }
  return {{"seed", seed},
          {"semantics", semantics},
          {"coverage", run.run.Coverage()},
          {"ape_share", OrNull(run.run.ErrorShare())},
          {"keypoints_dynamic", dynamic},
          {"keypoints_static", still},
          {"dynamic_share", run.DynamicShare()},
          {"holding_dynamic", holding_dynamic},
          {"holding_static", holding_still},
          {"speed_moving_m_per_s", run.moving_speed},
          {"speed_in_stop_m_per_s", run.stop_speed}};
}

void PrintRow(uint64_t seed, const char* semantics, const Run& run) {
  fmt::print("{:<6}{:<10}{:>10}{:>10}{:>11}{:>14}{:>13}\n", seed, semantics, Percent(run.run.Coverage(), 1),
             Percent(run.run.ErrorShare()), Percent(run.DynamicShare(), 1),
             fmt::format("{:.3f}", run.moving_speed), fmt::format("{:.3f}", run.stop_speed));
}

void RunInterference(const InterferenceArguments& arguments, int* exit_code) {
  const std::filesystem::path out = arguments.out, sequence = out / "sequence";
  PrepareOutputFolder(out);
  RunConsole console(arguments.quiet);
  nlohmann::ordered_json rows = nlohmann::ordered_json::array(), frames = nlohmann::ordered_json::array();
  std::vector<CurvePlot> plots;  // of the first scene
  const SceneOptions scene = LoadScene(arguments.scene);
  for (uint64_t seed = scene.seed; seed < scene.seed + static_cast<uint64_t>(arguments.seeds); ++seed) {
    SceneOptions options = scene;
    options.seed = seed;
    if (arguments.frames > 0) options.frames = arguments.frames;
    RenderScene(options, sequence);
    const Simulation simulation(options);
    const Run with = RunOnce(arguments, sequence, simulation, &console);
    const Run without = RunOnce(WithoutSemantics(arguments), sequence, simulation, &console);
    if (console.ShouldStop()) {
      *exit_code = kExitInterrupted;
      return;
    }
    if (rows.empty()) {
      fmt::print("{:<6}{:<10}{:>10}{:>10}{:>11}{:>14}{:>13}\n", "seed", "semantics", "coverage", "APE/path",
                 "on people", "m/s in motion", "m/s at rest");
      plots = {PlotCounts(with, options.camera),
               PlotSpeeds(simulation.truth(), with, without, options.camera)};
      WritePicture((out / "interference.png").string(),
                   DrawInterference(simulation.truth(), with, without, options.camera));
    }
    PrintRow(seed, "with", with);
    PrintRow(seed, "without", without);
    rows.push_back(Row(seed, true, with));
    rows.push_back(Row(seed, false, without));
    for (const KeypointCounts& count : with.counts) {
      frames.push_back({{"seed", seed},
                        {"timestamp", count.timestamp_s},
                        {"dynamic", count.dynamic},
                        {"static", count.still},
                        {"holding_dynamic", count.holding_dynamic},
                        {"holding_static", count.holding_still},
                        {"culled", count.culled}});
    }
  }
  WriteCsv(out / "interference.csv", rows);
  WriteBenchReport(out, "People always in view", arguments, rows, plots);
  WriteCsv(out / "interference_frames.csv", frames);
  WriteJson(out / "interference.json", {{"detector", arguments.detector},
                                        {"runs", rows},
                                        {"paper",
                                         {{"keypoints", kPaperKeypoints},
                                          {"keypoints_dynamic", kPaperDynamic},
                                          {"keypoints_static", kPaperStatic},
                                          {"dynamic_share", kPaperDynamicShare}}}});
  fmt::print("paper: {:.1f}% of the keypoints on people\nresults: {}\n", 100 * kPaperDynamicShare,
             arguments.out);
}

}  // namespace

void AddInterferenceCommand(CLI::App* bench, int* exit_code) {
  CLI::App* command = bench->add_subcommand(
      "interference", "People always in view; the camera stops and they go on (paper 4.2)");
  const auto arguments = std::make_shared<InterferenceArguments>();
  InterferenceArguments& a = *arguments;
  command->add_option("--scene", a.scene, "A scene with camera.stop_s")->capture_default_str();
  command->add_option("--seeds", a.seeds, "Scenes")->check(CLI::Range(1, 1000))->capture_default_str();
  command->add_option("--frames", a.frames, "Frames of each; default: the scene's")
      ->check(CLI::Range(1, 1000000));
  a.detector = "builtin";
  a.out = "out/bench_interference";
  AddRunOptions(command, "interference.csv, .json and .png (first seed), and the counts of each frame", &a);
  command->footer(
      "Keypoints are on people by the true mask. Speeds are displacements over half a second, in metres by "
      "the\n"
      "scale of the alignment with the truth. sequence/ in the results holds the images of the last seed.");
  command->callback([arguments, exit_code] { RunInterference(*arguments, exit_code); });
}

}  // namespace dynamic_slam
