#include "dynamic_slam/system/sequence_runner.h"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <sstream>

#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/system/frame_feed.h"

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

// Adds up what becomes of the frames.
class FrameLog {
 public:
  explicit FrameLog(RunSummary* summary) : summary_(summary) {}

  void Add(double timestamp_s, const FrameResult& result, const SharedMap& map) {
    const TrackingResult& tracking = result.tracking;
    const bool is_tracking = tracking.state == TrackingState::kTracking;
    if (tracking.part_was_erased) {
      ++summary_->reset_count;
      summary_->initialised_at.reset();
    }
    if (is_tracking && !summary_->initialised_at.has_value())
      summary_->initialised_at = summary_->frames.size();
    if (was_tracking_ && tracking.state == TrackingState::kLost) ++summary_->lost_count;
    was_tracking_ = is_tracking;
    summary_->most_keyframes_waiting = std::max(summary_->most_keyframes_waiting, result.keyframes_waiting);
    const auto [map_keyframes, map_landmarks] = SizesOf(map);
    if (!tracking.reason.empty()) summary_->reasons[summary_->frames.size()] = tracking.reason;
    summary_->frames.push_back({.timestamp_s = timestamp_s,
                                .tracking_ms = static_cast<float>(result.tracking_ms),
                                .keypoints = tracking.keypoints,
                                .inliers = tracking.inliers,
                                .dynamic = tracking.dynamic,
                                .objects = static_cast<int32_t>(result.objects.boxes.size()),
                                .map_keyframes = map_keyframes,
                                .map_landmarks = map_landmarks,
                                .state = tracking.state,
                                .keyframe_reason = tracking.keyframe_reason,
                                .detection = result.objects.state,
                                .map_was_erased = tracking.part_was_erased});
    if (tracking.keypoints > 0) {
      dynamic_ratios_ += static_cast<double>(tracking.dynamic.InBoxes()) / tracking.keypoints;
      summary_->mean_dynamic_ratio = dynamic_ratios_ / static_cast<double>(summary_->frames.size());
    }
    summary_->last_reason = is_tracking ? "" : tracking.reason;
  }

 private:
  static std::pair<uint32_t, uint32_t> SizesOf(const SharedMap& map) {
    const auto now = map.Read();
    return {static_cast<uint32_t>(now->keyframes().size()), static_cast<uint32_t>(now->landmarks().size())};
  }

  RunSummary* summary_;
  double dynamic_ratios_ = 0;  // their sum
  bool was_tracking_ = false;
};

TimeStatistics TimesOfTrackedFrames(const RunSummary& summary) {
  std::vector<double> times_ms;
  for (const RunSummary::FrameRecord& frame : summary.frames) {
    if (frame.state == TrackingState::kTracking) times_ms.push_back(frame.tracking_ms);
  }
  return SummariseTimes(std::move(times_ms));
}

}  // namespace

RunSummary RunSequence(FrameSource& source, SlamSystem& system, const RunControl& control) {
  RunSummary summary;
  summary.layout = source.Layout();
  summary.camera = system.camera().name;
  summary.mode = system.mode();
  summary.seed = system.options().seed;
  summary.startup_s = SecondsSinceProcessStart();
  const auto start = std::chrono::steady_clock::now();
  const auto should_stop = [&control] { return control.should_stop && control.should_stop(); };

  const size_t announced = source.FrameCount();
  FrameLog log(&summary);
  std::unique_ptr<FrameFeed> feed;
  const auto end_feed = [&summary, &feed] {
    if (feed != nullptr) summary.frames_dropped = feed->DroppedCount();
    feed.reset();  // and its thread: the source is ours again
  };
  try {
    feed = summary.mode == RunMode::kRealtime ? MakeRealtimeFeed(&source) : MakeDirectFeed(&source);
    while (true) {
      summary.interrupted = should_stop();
      if (summary.interrupted) break;
      const std::optional<SourceImage> image = feed->Next();
      if (!image.has_value()) break;
      if (const std::string reason = system.preparer().Refusal(image->image); !reason.empty()) {
        if (summary.frames.empty()) {
          throw InputError(image->name, reason, "Check --camera and the options image.* against the images.");
        }
        summary.skipped.push_back({image->name, reason});
        continue;
      }
      const FrameResult result =
          system.Process(image->timestamp_s, image->image, control.mask ? control.mask(*image) : cv::Mat());
      log.Add(image->timestamp_s, result, system.map());
      if (control.on_frame)
        control.on_frame({summary.frames.size(), announced, &*image, &result, &summary.frames.back(),
                          &system.frame(), &system.map(), system.detector()});
    }
    end_feed();
    if (summary.interrupted) system.Stop();
    summary.final_bundle = system.Finish(should_stop);
    summary.interrupted |= summary.final_bundle.stopped;
  } catch (...) {
    summary.failure = std::current_exception();
    end_feed();
    system.Stop();
  }

  summary.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  summary.skipped.insert(summary.skipped.end(), source.Problems().begin(), source.Problems().end());
  const size_t seen = summary.frames.size() + summary.frames_dropped + summary.skipped.size();
  const bool is_whole = !summary.interrupted && summary.failure == nullptr;
  summary.frames_total = is_whole ? std::max(announced, seen) : seen;
  summary.frames_tracked = system.LiveFrameCount();
  const Trajectory path = system.FrameTrajectory();
  summary.frames_backfilled = path.size() - summary.frames_tracked;
  const std::vector<PartId> parts = system.Parts();
  for (size_t i = 1; i < parts.size(); ++i)
    summary.frames_in_other_maps += system.FrameTrajectory(parts[i]).size();
  summary.pieces_cut = system.PiecesCut();
  summary.frames_refuted = system.FramesRefuted();
  summary.lens_doubt = system.LensDoubt();
  summary.leaps = FindLeaps(path);
  {
    const auto map = system.map().Read();
    summary.keyframes = map->keyframes().size();
    summary.landmarks = map->landmarks().size();
    summary.maps = map->Parts().size();
  }
  summary.mapping = system.mapping_report();
  summary.loops = system.loop_report();
  if (system.detector() != nullptr) summary.detector = system.detector()->name();
  summary.detection = system.detection_report();
  summary.tracking_ms = TimesOfTrackedFrames(summary);
  summary.mapping_ms = SummariseTimes(summary.mapping.times_ms);
  summary.peak_rss_mb = PeakRssMb();
  return summary;
}

}  // namespace dynamic_slam
