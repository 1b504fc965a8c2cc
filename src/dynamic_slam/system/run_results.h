#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dynamic_slam/base/file_backed_vector.h"
#include "dynamic_slam/geometry/metric_scale.h"
#include "dynamic_slam/geometry/path_leaps.h"
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
  RunMode mode = RunMode::kOffline;
  uint64_t seed = 0;
  size_t frames_total = 0;       // images that the source announced, unreadable and dropped ones included
  size_t frames_tracked = 0;     // live: with a pose when their turn came, in the map that was kept
  size_t frames_backfilled = 0;  // given one later: of the map's start, or in the finished map
  size_t frames_dropped = 0;     // realtime: came while tracking was late
  size_t keyframes = 0, landmarks = 0;
  size_t maps = 0;                       // parts of the map that nothing ties together
  size_t frames_in_other_maps = 0;       // have a pose, but not in the one with the most
  std::optional<size_t> initialised_at;  // frame, counted from 0
  int lost_count = 0;                    // times that tracking was lost
  int reset_count = 0;         // times that a map was given up: lost while small, or started wrongly
  TimeStatistics tracking_ms;  // of the tracked frames
  TimeStatistics mapping_ms;   // of the keyframes; not in tracking_ms
  MappingReport mapping;
  LoopReport loops;
  std::string detector = "none";
  std::optional<DetectionReport> detection;  // of the detector, if there is one
  double mean_dynamic_ratio = 0;             // keypoints in dynamic boxes over all, mean over frames
  int most_keyframes_waiting = 0;            // for local mapping, at any time
  BundleSummary final_bundle;
  double startup_s = 0;  // from the start of the process to the first frame
  double wall_s = 0;     // from the first frame to the final map
  double peak_rss_mb = 0;
  int pieces_cut = 0;                         // of the path, that stood wrong (SlamSystem::PiecesCut)
  size_t frames_refuted = 0;                  // by the finished map (SlamSystem::FramesRefuted)
  std::optional<SelfCalibration> lens_doubt;  // SlamSystem::LensDoubt
  // Where the path of the main map leaps: unless the film has a cut there, one side stands wrong.
  std::vector<PathLeap> leaps;
  std::optional<MetricScale> scale;  // of the main part of the map, if anything says how long its unit is
  bool interrupted = false;
  std::exception_ptr failure;          // what ended the run early, if anything was thrown
  std::string last_reason;             // what tracking said last, while it had no pose
  std::vector<SourceProblem> skipped;  // images that could not be used

  // One line of frames.csv, but for the reason.
  struct FrameRecord {
    double timestamp_s = 0;
    float tracking_ms = 0;
    int32_t keypoints = 0, inliers = 0;
    DynamicKeypoints dynamic;
    int32_t objects = 0;                            // seen or believed to be in the frame
    uint32_t map_keyframes = 0, map_landmarks = 0;  // when the frame was done
    TrackingState state = TrackingState::kInitialising;
    KeyframeReason keyframe_reason = KeyframeReason::kNone;
    DetectionState detection = DetectionState::kOff;
    bool map_was_erased = false;  // the part of the map that the camera was in
  };
  FileBackedVector<FrameRecord> frames;
  // Why a frame has no pose, or how it came to have one again, by its place in `frames`; most have none.
  std::map<size_t, std::string> reasons;
  std::string_view ReasonOf(size_t frame) const {
    const auto reason = reasons.find(frame);
    return reason == reasons.end() ? std::string_view() : reason->second;
  }
  double Coverage() const {  // live
    return frames_total == 0 ? 0 : static_cast<double>(frames_tracked) / static_cast<double>(frames_total);
  }
};

// What `failure` says; "" when there is none.
std::string FailureMessage(const RunSummary& summary);

// Writes trajectory.txt, trajectory_2.txt and so on for further parts of the map, keyframes.txt, frames.csv,
// loops.csv, map.ply, config.yaml, summary.json and, for a KITTI source in which every frame has a pose,
// trajectory_kitti.txt into the folder, which is made. With a scale, what is of the main part is in metres.
// Throws InputError when that is not possible.
void WriteResults(const std::filesystem::path& folder, const SlamSystem& system, const RunSummary& summary);

// trajectory.txt, and trajectory_2.txt and so on; those of an earlier run in the folder go. Throws
// InputError.
void WriteTrajectories(const std::filesystem::path& folder, std::span<const Trajectory> trajectories);

// frames.csv, line by line.
std::string FramesCsvHeader();
std::string FramesCsvRow(const RunSummary::FrameRecord& frame, std::string_view reason);

// Makes the folder and checks that files can be written there, so that a long run does not end in an error.
void PrepareOutputFolder(const std::filesystem::path& folder);

}  // namespace dynamic_slam
