#include "dynamic_slam/system/run_results.h"

#include <algorithm>
#include <fstream>
#include <numeric>
#include <system_error>

#include <nlohmann/json.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/point_cloud_file.h"
#include "dynamic_slam/io/trajectory_file.h"

namespace dynamic_slam {
namespace {

nlohmann::ordered_json ToJson(const TimeStatistics& times) {
  return {{"median", times.median}, {"mean", times.mean}, {"p95", times.p95}, {"max", times.max}};
}

nlohmann::ordered_json ToJson(const RunSummary& summary) {
  nlohmann::ordered_json json;
  json["source"] = summary.source;
  json["layout"] = summary.layout;
  json["camera"] = summary.camera;
  json["frames_total"] = summary.frames_total;
  json["frames_tracked"] = summary.frames_tracked;
  json["frames_backfilled"] = summary.frames_backfilled;
  json["frames_dropped"] = summary.frames_dropped;
  json["coverage"] = summary.Coverage();
  json["keyframes"] = summary.keyframes;
  json["landmarks"] = summary.landmarks;
  json["maps"] = summary.maps;
  json["frames_in_other_maps"] = summary.frames_in_other_maps;
  if (summary.initialised_at.has_value()) {
    json["initialised_at"] = *summary.initialised_at;
  } else {
    json["initialised_at"] = nullptr;
  }
  json["lost_count"] = summary.lost_count;
  json["reset_count"] = summary.reset_count;
  json["last_reason"] = summary.last_reason;
  json["tracking_ms"] = ToJson(summary.tracking_ms);
  json["mapping_ms"] = ToJson(summary.mapping_ms);
  json["startup_s"] = summary.startup_s;
  json["wall_s"] = summary.wall_s;
  json["peak_rss_mb"] = summary.peak_rss_mb;
  json["mapping"] = {{"landmarks_created", summary.mapping.landmarks_created},
                     {"landmarks_culled", summary.mapping.landmarks_culled},
                     {"landmarks_merged", summary.mapping.landmarks_merged},
                     {"keyframes_culled", summary.mapping.keyframes_culled},
                     {"keyframes_abandoned", summary.mapping.keyframes_abandoned},
                     {"bundles_stopped", summary.mapping.bundles_stopped},
                     {"most_keyframes_waiting", summary.most_keyframes_waiting}};
  json["loops"] = {
      {"corrected", summary.loops.corrected},
      {"joined", summary.loops.joined},
      {"linked", summary.loops.linked},
      {"refused", std::count_if(summary.loops.attempts.begin(), summary.loops.attempts.end(),
                                [](const LoopAttempt& attempt) { return !attempt.reason.empty(); })},
      {"landmarks_merged", summary.loops.landmarks_merged},
      {"revisit_links", summary.loops.revisit_links},
      {"bundles", summary.loops.bundles},
      {"bundles_stopped", summary.loops.bundles_stopped}};
  if (summary.detection.has_value()) {
    const DetectionReport& detection = *summary.detection;
    json["detector"] = {{"name", summary.detector},
                        {"asked", detection.asked},
                        {"on_time", detection.on_time},
                        {"late", detection.late},
                        {"failed", detection.failed},
                        {"last_failure", detection.last_failure},
                        {"ms", ToJson(SummariseTimes(detection.times_ms))}};
  } else {
    json["detector"] = {{"name", summary.detector}};
  }
  json["dynamic_keypoints"] = {{"mean_ratio", summary.mean_dynamic_ratio}};
  json["final_bundle"] = {{"done", summary.final_bundle.usable},
                          {"stopped", summary.final_bundle.stopped},
                          {"iterations", summary.final_bundle.iterations},
                          {"initial_cost", summary.final_bundle.initial_cost},
                          {"final_cost", summary.final_bundle.final_cost}};
  json["pieces_cut"] = summary.pieces_cut;
  json["frames_refuted"] = summary.frames_refuted;
  if (summary.lens_doubt.has_value()) {
    json["lens_doubt"] = {{"k1", summary.lens_doubt->k1},
                          {"k2", summary.lens_doubt->k2},
                          {"gain", summary.lens_doubt->lens_gain}};
  }
  json["leaps"] = nlohmann::ordered_json::array();
  for (const PathLeap& leap : summary.leaps) {
    json["leaps"].push_back(
        {{"from", leap.from_s}, {"to", leap.to_s}, {"times_too_fast", leap.times_too_fast}});
  }
  if (summary.scale.has_value()) {
    json["scale"] = {{"metres_per_unit", summary.scale->metres_per_unit},
                     {"relative_error", summary.scale->relative_error},
                     {"from", summary.scale->from}};
  }
  json["mode"] = Name(summary.mode);
  json["seed"] = summary.seed;
  json["version"] = DYNAMIC_SLAM_VERSION;
  json["interrupted"] = summary.interrupted;
  json["failure"] = FailureMessage(summary);
  json["skipped"] = nlohmann::ordered_json::array();
  for (const SourceProblem& problem : summary.skipped) {
    json["skipped"].push_back({{"name", problem.name}, {"reason", problem.reason}});
  }
  return json;
}

std::string LoopsCsv(const std::vector<LoopAttempt>& attempts) {
  std::string csv =
      "timestamp,keyframe,candidate,candidate_timestamp,score,matches,sim3_inliers,visible,inliers,"
      "confirming,"
      "scale,drift_px,refused\n";
  for (const LoopAttempt& attempt : attempts) {
    csv +=
        fmt::format("{:.9f},{},{},{:.9f},{:.4f},{},{},{},{},{},{:.4f},{:.2f},\"{}\"\n", attempt.timestamp_s,
                    attempt.keyframe.value(), attempt.candidate.value(), attempt.candidate_timestamp_s,
                    attempt.score, attempt.matches, attempt.sim3_inliers, attempt.visible, attempt.inliers,
                    attempt.confirming, attempt.scale, attempt.drift_px, attempt.reason);
  }
  return csv;
}

Trajectory Scaled(Trajectory trajectory, double factor) {
  for (StampedPose& pose : trajectory) pose.world_from_cam.translation *= factor;
  return trajectory;
}

std::vector<Eigen::Vector3f> LandmarksOfMainPart(const SlamSystem& system, double factor) {
  std::vector<Eigen::Vector3f> points;
  const std::vector<PartId> parts = system.Parts();
  if (parts.empty()) return points;
  const auto map = system.map().Read();
  map->landmarks().ForEach([&](const Landmark& landmark) {
    if (map->PartOf(landmark) != parts.front()) return;
    points.push_back((factor * landmark.position()).cast<float>());
  });
  return points;
}

}  // namespace

std::string FramesCsvHeader() {
  return "timestamp,state,keypoints,inliers,keyframe,detection,objects,static,dynamic,culled,kept,"
         "tracking_ms,reason\n";
}

std::string FramesCsvRow(const RunSummary::FrameRecord& frame, std::string_view reason) {
  return fmt::format("{:.9f},{},{},{},{},{},{},{},{},{},{},{:.3f},\"{}\"\n", frame.timestamp_s,
                     Name(frame.state), frame.keypoints, frame.inliers, Name(frame.keyframe_reason),
                     Name(frame.detection), frame.objects, frame.dynamic.outside, frame.dynamic.InBoxes(),
                     frame.dynamic.culled, frame.dynamic.kept, frame.tracking_ms, reason);
}

void WriteTrajectories(const std::filesystem::path& folder, std::span<const Trajectory> trajectories) {
  WriteTumTrajectory(folder / "trajectory.txt", trajectories.empty() ? Trajectory() : trajectories.front());
  for (size_t i = 1;; ++i) {
    const std::filesystem::path file = folder / fmt::format("trajectory_{}.txt", i + 1);
    std::error_code ignored;
    if (i < trajectories.size()) {
      WriteTumTrajectory(file, trajectories[i]);
    } else if (!std::filesystem::remove(file, ignored)) {
      return;
    }
  }
}

TimeStatistics SummariseTimes(std::vector<double> times) {
  if (times.empty()) return {};
  std::sort(times.begin(), times.end());
  const size_t n = times.size();
  const double sum = std::accumulate(times.begin(), times.end(), 0.0);
  return {n % 2 == 1 ? times[n / 2] : 0.5 * (times[n / 2 - 1] + times[n / 2]), sum / static_cast<double>(n),
          times[(n * 95 + 99) / 100 - 1], times.back()};
}

std::string FailureMessage(const RunSummary& summary) {
  if (summary.failure == nullptr) return "";
  try {
    std::rethrow_exception(summary.failure);
  } catch (const std::exception& error) {
    return error.what();
  } catch (...) {
    return "unknown";
  }
}

void PrepareOutputFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  const std::filesystem::path probe = folder / ".write_test";
  if (error || !std::ofstream(probe)) {
    throw InputError(folder.string(), error ? error.message() : "no permission to write there",
                     "Choose another folder with --out.");
  }
  std::filesystem::remove(probe, error);
}

void WriteResults(const std::filesystem::path& folder, const SlamSystem& system, const RunSummary& summary) {
  PrepareOutputFolder(folder);
  const double factor = summary.scale.has_value() ? summary.scale->metres_per_unit : 1;  // of the main part
  const Trajectory trajectory = Scaled(system.FrameTrajectory(), factor);
  std::vector<Trajectory> trajectories;
  for (const PartId part : system.Parts()) {
    trajectories.push_back(trajectories.empty() ? trajectory : system.FrameTrajectory(part));
  }
  WriteTrajectories(folder, trajectories);
  WriteTumTrajectory(folder / "keyframes.txt", Scaled(system.KeyframeTrajectory(), factor));
  const std::filesystem::path kitti = folder / "trajectory_kitti.txt";
  std::error_code ignored;
  std::filesystem::remove(kitti, ignored);
  if (summary.layout == "kitti" && !trajectory.empty() && trajectory.size() == summary.frames_total) {
    std::vector<Rigid3> poses;
    for (const StampedPose& pose : trajectory) poses.push_back(pose.world_from_cam);
    WriteKittiPoses(kitti, poses);
  }
  std::string frames = FramesCsvHeader();
  for (size_t i = 0; i < summary.frames.size(); ++i) {
    frames += FramesCsvRow(summary.frames[i], summary.ReasonOf(i));
  }
  WriteFileAtomically(folder / "frames.csv", frames);
  WriteFileAtomically(folder / "loops.csv", LoopsCsv(summary.loops.attempts));
  WritePly(folder / "map.ply", LandmarksOfMainPart(system, factor));
  WriteFileAtomically(folder / "config.yaml", OptionsToYaml(system.options()));
  WriteFileAtomically(
      folder / "summary.json",
      ToJson(summary).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

}  // namespace dynamic_slam
