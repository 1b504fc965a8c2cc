#include "dynamic_slam/system/sequence_runner.h"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <numeric>
#include <sstream>
#include <system_error>

#include <nlohmann/json.hpp>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/io/point_cloud_file.h"
#include "dynamic_slam/io/trajectory_file.h"

namespace dynamic_slam {
namespace {

// Seconds since the kernel made this process: what the user waited, loading of libraries included.
double SecondsSinceProcessStart() {
  std::ifstream stat("/proc/self/stat");
  std::string line;
  std::getline(stat, line);
  const size_t after_name = line.rfind(')');
  if (after_name == std::string::npos) return 0;
  std::istringstream fields(line.substr(after_name + 1));
  std::string field;
  for (int i = 0; i < 19; ++i) fields >> field;  // fields 3 to 21
  double start_ticks = 0;
  fields >> start_ticks;
  timespec now{};
  clock_gettime(CLOCK_BOOTTIME, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) -
         start_ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

double PeakRssMb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

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
  json["coverage"] = summary.Coverage();
  json["keyframes"] = summary.keyframes;
  json["landmarks"] = summary.landmarks;
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
  json["mode"] = summary.mode;
  json["seed"] = summary.seed;
  json["version"] = DYNAMIC_SLAM_VERSION;
  json["interrupted"] = summary.interrupted;
  json["skipped"] = nlohmann::ordered_json::array();
  for (const SourceProblem& problem : summary.skipped) {
    json["skipped"].push_back({{"name", problem.name}, {"reason", problem.reason}});
  }
  return json;
}

void WriteText(const std::filesystem::path& file, const std::string& text) {
  const std::filesystem::path temporary = file.string() + ".tmp";
  std::ofstream stream(temporary, std::ios::binary);
  stream << text;
  stream.close();
  std::error_code error;
  if (stream) std::filesystem::rename(temporary, file, error);
  if (!stream || error) {
    throw InputError(file.string(), "cannot be written",
                     "Choose another folder with --out, or free some space.");
  }
}

std::string FramesCsv(const std::vector<RunSummary::FrameRecord>& frames) {
  std::string csv = "timestamp,state,keypoints,inliers,keyframe,tracking_ms,reason\n";
  for (const RunSummary::FrameRecord& frame : frames) {
    csv += fmt::format("{:.9f},{},{},{},{},{:.3f},\"{}\"\n", frame.timestamp_s, Name(frame.state),
                       frame.keypoints, frame.inliers, Name(frame.keyframe_reason), frame.tracking_ms,
                       frame.reason);
  }
  return csv;
}

}  // namespace

TimeStatistics SummariseTimes(std::vector<double> times) {
  if (times.empty()) return {};
  std::sort(times.begin(), times.end());
  const size_t n = times.size();
  const double sum = std::accumulate(times.begin(), times.end(), 0.0);
  return {n % 2 == 1 ? times[n / 2] : 0.5 * (times[n / 2 - 1] + times[n / 2]), sum / static_cast<double>(n),
          times[(n * 95 + 99) / 100 - 1], times.back()};
}

RunSummary RunSequence(FrameSource& source, SlamSystem& system,
                       const std::function<bool(const RunProgress&)>& on_frame) {
  RunSummary summary;
  summary.layout = source.Layout();
  summary.camera = system.camera().name;
  summary.seed = system.options().seed;
  summary.startup_s = SecondsSinceProcessStart();
  const auto start = std::chrono::steady_clock::now();

  std::vector<double> tracking_ms, mapping_ms;
  size_t frames = 0;
  bool was_tracking = false;
  while (!summary.interrupted) {
    const std::optional<SourceImage> image = source.Next();
    if (!image.has_value()) break;
    if (const std::string reason = system.preparer().Refusal(image->image); !reason.empty()) {
      if (frames == 0) {
        throw InputError(image->name, reason, "Check --camera and the options image.* against the images.");
      }
      summary.skipped.push_back({image->name, reason});
      continue;
    }
    const FrameResult result = system.Process(image->timestamp_s, image->image);
    const bool tracking = result.tracking.state == TrackingState::kTracking;
    if (result.tracking.map_was_reset) {
      ++summary.reset_count;
      summary.initialised_at.reset();
    }
    if (tracking) {
      if (!summary.initialised_at.has_value()) summary.initialised_at = frames;
      tracking_ms.push_back(result.tracking_ms);
    }
    if (!result.tracking.new_keyframes.empty()) mapping_ms.push_back(result.mapping_ms);
    if (was_tracking && result.tracking.state == TrackingState::kLost) ++summary.lost_count;
    was_tracking = tracking;
    summary.frames.push_back({image->timestamp_s, result.tracking.state, result.tracking.keypoints,
                              result.tracking.inliers, result.tracking.keyframe_reason, result.tracking_ms,
                              result.tracking.reason});
    summary.last_reason = tracking ? "" : result.tracking.reason;
    ++frames;
    const RunProgress progress{frames, source.FrameCount(), &result, &system.map()};
    if (on_frame && !on_frame(progress)) summary.interrupted = true;
  }
  system.Finish();

  summary.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  summary.skipped.insert(summary.skipped.end(), source.Problems().begin(), source.Problems().end());
  summary.frames_total = summary.interrupted ? frames + summary.skipped.size()
                                             : std::max(source.FrameCount(), frames + summary.skipped.size());
  summary.frames_tracked = system.LiveFrameCount();
  summary.frames_backfilled = system.FrameTrajectory().size() - summary.frames_tracked;
  summary.keyframes = system.map().keyframes().size();
  summary.landmarks = system.map().landmarks().size();
  summary.tracking_ms = SummariseTimes(std::move(tracking_ms));
  summary.mapping_ms = SummariseTimes(std::move(mapping_ms));
  summary.peak_rss_mb = PeakRssMb();
  return summary;
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
  const Trajectory trajectory = system.FrameTrajectory();
  WriteTumTrajectory(folder / "trajectory.txt", trajectory);
  WriteTumTrajectory(folder / "keyframes.txt", system.KeyframeTrajectory());
  const std::filesystem::path kitti = folder / "trajectory_kitti.txt";
  std::error_code ignored;
  std::filesystem::remove(kitti, ignored);
  if (summary.layout == "kitti" && !trajectory.empty() && trajectory.size() == summary.frames_total) {
    std::vector<Rigid3> poses;
    for (const StampedPose& pose : trajectory) poses.push_back(pose.world_from_cam);
    WriteKittiPoses(kitti, poses);
  }
  WriteText(folder / "frames.csv", FramesCsv(summary.frames));
  std::vector<Eigen::Vector3f> points;
  system.map().landmarks().ForEach(
      [&points](const Landmark& landmark) { points.push_back(landmark.position().cast<float>()); });
  WritePly(folder / "map.ply", points);
  WriteText(folder / "config.yaml", OptionsToYaml(system.options()));
  WriteText(folder / "summary.json",
            ToJson(summary).dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

}  // namespace dynamic_slam
