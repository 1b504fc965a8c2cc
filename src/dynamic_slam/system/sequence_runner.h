#pragma once

#include <cstddef>
#include <functional>

#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/system/run_results.h"
#include "dynamic_slam/system/slam_system.h"

namespace dynamic_slam {

struct RunProgress {
  size_t frame = 0;
  size_t frames_total = 0;  // 0 when unknown
  const SourceImage* image = nullptr;
  const FrameResult* result = nullptr;
  const RunSummary::FrameRecord* record = nullptr;
  const Frame* frame_in_work = nullptr;  // keypoints and what became of them
  const SharedMap* map = nullptr;
  const Detector* detector = nullptr;  // that named the objects of the result; none without one
};

// What a run asks and tells while it goes on; each may be empty.
struct RunControl {
  std::function<void(const RunProgress&)> on_frame = {};  // after each image
  std::function<bool()> should_stop = {};                 // asked often: true ends the run early
  std::function<cv::Mat(const SourceImage&)> mask = {};   // of Process, for each image
};

// Runs every image of the source through the system, then Finish(); in realtime mode at the pace of the time
// stamps. A run that is stopped, or in which something throws (RunSummary::failure), ends soon and with all
// results so far. An image that cannot be prepared is skipped as one that cannot be read; the first one is a
// failure.
RunSummary RunSequence(FrameSource& source, SlamSystem& system, const RunControl& control = {});

}  // namespace dynamic_slam
