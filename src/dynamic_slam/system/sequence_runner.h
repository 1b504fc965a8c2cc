#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/system/slam_system.h"

namespace dynamic_slam {

struct TimeStatistics {
  double median = 0, mean = 0, p95 = 0, max = 0;
};

TimeStatistics SummariseTimes(std::vector<double> times);

// Everything that summary.json says of a run.
struct RunSummary {
  std::string source, layout, camera;
  std::string mode = "offline";
  uint64_t seed = 0;
  size_t frames_total = 0;       // images that the source announced, unreadable ones included
  size_t frames_tracked = 0;     // live: with a pose when their turn came, in the map that was kept
  size_t frames_backfilled = 0;  // given one later: those before the start of which the map was made
  size_t keyframes = 0, landmarks = 0;
  std::optional<size_t> initialised_at;  // frame, counted from 0
  int lost_count = 0;                    // times that tracking was lost
  int reset_count = 0;         // times that a map was given up: lost while small, or started wrongly
  TimeStatistics tracking_ms;  // of the tracked frames
  TimeStatistics mapping_ms;   // of the keyframes; runs inline and is not in tracking_ms
  double startup_s = 0;        // from the start of the process to the first frame
  double wall_s = 0;           // from the first frame to the final map
  double peak_rss_mb = 0;
  bool interrupted = false;
  std::string last_reason;             // what tracking said last, while it had no pose
  std::vector<SourceProblem> skipped;  // images that could not be used

  // One line of frames.csv.
  struct FrameRecord {
    double timestamp_s = 0;
    TrackingState state = TrackingState::kInitialising;
    int keypoints = 0, inliers = 0;
    KeyframeReason keyframe_reason = KeyframeReason::kNone;
    double tracking_ms = 0;
    std::string reason;
  };
  std::vector<FrameRecord> frames;
  double Coverage() const {  // live
    return frames_total == 0 ? 0 : static_cast<double>(frames_tracked) / static_cast<double>(frames_total);
  }
};

struct RunProgress {
  size_t frame = 0;
  size_t frames_total = 0;  // 0 when unknown
  const FrameResult* result = nullptr;
  const Map* map = nullptr;
};

// Runs every image of the source through the system, then Finish(). `on_frame` may be empty and is called
// after each image; returning false ends the run early, with all results so far. An image that cannot be
// prepared is skipped as one that cannot be read; throws InputError when it is the first.
RunSummary RunSequence(FrameSource& source, SlamSystem& system,
                       const std::function<bool(const RunProgress&)>& on_frame);

// Writes trajectory.txt, keyframes.txt, frames.csv, map.ply, config.yaml, summary.json and, for a KITTI
// source in which every frame has a pose, trajectory_kitti.txt into the folder, which is made. Throws
// InputError when that is not possible.
void WriteResults(const std::filesystem::path& folder, const SlamSystem& system, const RunSummary& summary);

// Makes the folder and checks that files can be written there, so that a long run does not end in an error.
void PrepareOutputFolder(const std::filesystem::path& folder);

}  // namespace dynamic_slam
