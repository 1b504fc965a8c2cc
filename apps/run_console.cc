#include "run_console.h"

#include <atomic>
#include <csignal>
#include <cstdio>

#include <fmt/core.h>
#include <unistd.h>

namespace dynamic_slam {
namespace {

using Clock = std::chrono::steady_clock;

// Any thread may be the one that takes the signal.
std::atomic<bool> interrupted = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a handler must not wait");

// A second one ends the program at once.
void OnInterrupt(int signal) {
  interrupted = true;
  std::signal(signal, SIG_DFL);
}

// Whether or not anybody can read it.
void PrintLine(const std::string& text) { std::fputs(text.c_str(), stderr); }

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace

RunConsole::RunConsole(bool quiet)
    : quiet_(quiet), overwrite_(isatty(STDERR_FILENO) != 0), start_(Clock::now()), last_line_(start_) {
  interrupted = false;
  std::signal(SIGINT, OnInterrupt);
  std::signal(SIGTERM, OnInterrupt);
}

RunConsole::~RunConsole() {
  std::signal(SIGINT, SIG_DFL);
  std::signal(SIGTERM, SIG_DFL);
}

bool RunConsole::ShouldStop() const { return interrupted; }

void RunConsole::Say(const std::string& text) const {
  PrintLine(fmt::format("{}{}\n", overwrite_ ? "\r\033[K" : "", text));
}

void RunConsole::Show(const RunProgress& progress) {
  if (quiet_) return;
  const TrackingResult& tracking = progress.result->tracking;
  const bool changed = tracking.state != last_state_;
  last_state_ = tracking.state;
  if (changed) {
    End();
    PrintLine(fmt::format("frame {}: {}{}{}\n", progress.frame - 1, Name(tracking.state),
                          tracking.reason.empty() ? "" : ": ", tracking.reason));
  }
  // A file gets a line every five seconds, a terminal five a second.
  if (SecondsSince(last_line_) < (overwrite_ ? 0.2 : 5.0)) return;
  last_line_ = Clock::now();
  size_t keyframes = 0, landmarks = 0;
  {
    const auto map = progress.map->Read();
    keyframes = map->keyframes().size();
    landmarks = map->landmarks().size();
  }
  const std::string total = progress.frames_total > 0 ? fmt::format("/{}", progress.frames_total) : "";
  PrintLine(fmt::format("{}frame {}{}  {:.0f} frames/s  {}  {} inliers  {} keyframes  {} landmarks  {}{}",
                        overwrite_ ? "\r\033[K" : "", progress.frame, total,
                        static_cast<double>(progress.frame) / SecondsSince(start_), Name(tracking.state),
                        tracking.inliers, keyframes, landmarks,
                        tracking.state == TrackingState::kTracking ? "" : tracking.reason,
                        overwrite_ ? "" : "\n"));
  line_open_ = overwrite_;
  std::fflush(stderr);
}

void RunConsole::End() {
  if (!line_open_) return;
  PrintLine("\r\033[K");
  line_open_ = false;
}

void PrintSummary(const RunSummary& summary) {
  fmt::print("{} of {} frames tracked ({:.1f}%), {} more have a pose, {} keyframes, {} landmarks\n",
             summary.frames_tracked, summary.frames_total, 100.0 * summary.Coverage(),
             summary.frames_backfilled, summary.keyframes, summary.landmarks);
  if (summary.frames_dropped > 0) {
    fmt::print("{} frames dropped: they came while tracking was late\n", summary.frames_dropped);
  }
  if (summary.interrupted) fmt::print("interrupted: these are the results up to then\n");
  if (summary.failure != nullptr) fmt::print("failed: these are the results up to then\n");
  if (summary.initialised_at.has_value()) {
    fmt::print("initialised at frame {}, lost {} times\n", *summary.initialised_at, summary.lost_count);
  } else {
    fmt::print("no map was made: {}\n", summary.last_reason);
  }
  if (summary.frames_in_other_maps > 0) {
    fmt::print("{} frames are in other maps, which nothing joins to this one: trajectory_2.txt and on\n",
               summary.frames_in_other_maps);
  }
  if (summary.pieces_cut > 0) {
    fmt::print(
        "{} of the path stood wrong and {} cut off; what is not found again in the rest is "
        "apart, or has no pose\n",
        summary.pieces_cut == 1 ? "a piece" : fmt::format("{} pieces", summary.pieces_cut),
        summary.pieces_cut == 1 ? "is" : "are");
  }
  if (summary.frames_refuted > 0) {
    fmt::print(
        "{} frames have lost their pose: the finished map does not confirm it, and the camera cannot have "
        "been there\n",
        summary.frames_refuted);
  }
  if (summary.lens_doubt.has_value()) {
    fmt::print(
        "the lens seems to bend lines otherwise than the camera says (about k1 = {:.4f}, k2 = {:.4f}): "
        "sightings were not aligned; `dynamic_slam doctor` says what to write into a camera file\n",
        summary.lens_doubt->k1, summary.lens_doubt->k2);
  }
  for (const PathLeap& leap : summary.leaps) {
    fmt::print(
        "the path leaps {:.2f} s after the first frame, {:.1f} times faster than can be: unless the film has "
        "a cut, one side stands wrong\n",
        leap.from_s - summary.frames[0].timestamp_s, leap.times_too_fast);
  }
  for (const SourceProblem& problem : summary.skipped)
    fmt::print("skipped {}: {}\n", problem.name, problem.reason);
  fmt::print("tracking {:.1f} ms a frame (median), mapping {:.1f} ms a keyframe, {:.1f} s in all\n",
             summary.tracking_ms.median, summary.mapping_ms.median, summary.wall_s);
}

}  // namespace dynamic_slam
