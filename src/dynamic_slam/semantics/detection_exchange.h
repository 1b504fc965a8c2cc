#pragma once

#include <chrono>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/base/mutex.h"
#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// What the detector said of one frame.
struct DetectionResult {
  FrameId frame;
  std::vector<Detection> detections;
  std::string failure;  // why there is no result; empty when there is one
};

// Whether an answer that is to be used from the stamp `due_s` on may be used for an image of `timestamp_s`:
// the simulated slow network of `run` and of `detect`. Stamps are rounded, so one that is a little early
// counts.
inline bool IsAnswerDue(double due_s, double timestamp_s) {
  constexpr double kStampTolerance_s = 1e-4;
  return timestamp_s + kStampTolerance_s >= due_s;
}

// The hand-off from the detection thread to tracking: the paper's `Detection` class (section 3.3), safe to
// write and read from two threads. Keyed by frame, so that a result is never taken for another frame's.
class DetectionExchange {
 public:
  void Write(DetectionResult result);

  // Waits for the frame's result until the deadline at most; none when it has not come by then.
  std::optional<DetectionResult> Read(FrameId frame, std::chrono::steady_clock::time_point deadline);

  // What has come and was not read, in the order of coming.
  std::vector<DetectionResult> ReadAll();

 private:
  // Nobody reads results for longer than that: the oldest go.
  static constexpr size_t kMostResults = 16;

  Mutex mutex_;
  CondVar written_;
  std::deque<DetectionResult> results_ DS_GUARDED_BY(mutex_);
};

}  // namespace dynamic_slam
