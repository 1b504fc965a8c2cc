#include "dynamic_slam/system/slam_system.h"

#include <algorithm>
#include <chrono>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {
namespace {

double MillisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

const Camera& Validated(const Camera& camera, const SystemOptions& options) {
  camera.Validate();
  CheckOptions(options);
  return camera;
}

}  // namespace

SlamSystem::SlamSystem(const Camera& camera, const SystemOptions& options)
    : camera_(Validated(camera, options)),
      options_(options),
      map_(OctaveScales(options.orb)),
      tracker_(camera, options.orb, options.tracker, options.seed, &map_),
      mapper_(camera, options.mapper, &map_) {}

FrameResult SlamSystem::Process(double timestamp_s, const cv::Mat& grey, const cv::Mat& mask) {
  DS_CHECK(grey.type() == CV_8UC1 && grey.cols == camera_.width && grey.rows == camera_.height,
           "image {} x {} type {}, camera {} x {}", grey.cols, grey.rows, grey.type(), camera_.width,
           camera_.height);
  FrameResult result;
  result.id = FrameId(frame_count_++);
  auto start = std::chrono::steady_clock::now();
  result.tracking = tracker_.Track(result.id, timestamp_s, grey, mask);
  result.tracking_ms = MillisecondsSince(start);

  if (result.tracking.map_was_reset) {
    mapper_.Reset();
    tracked_.clear();
  }
  if (result.tracking.state == TrackingState::kTracking) {
    const Frame& frame = tracker_.frame();
    for (const EarlierFrame& earlier : result.tracking.earlier_frames) {
      tracked_.push_back({earlier.timestamp_s, earlier.reference, earlier.cam_from_reference, false});
    }
    tracked_.push_back({timestamp_s, frame.reference, frame.cam_from_reference, true});
  }
  start = std::chrono::steady_clock::now();
  for (const KeyframeId keyframe : result.tracking.new_keyframes) mapper_.Process(keyframe);
  result.mapping_ms = MillisecondsSince(start);
  return result;
}

void SlamSystem::Finish() {
  DS_TRACE("finish");
  if (options_.final_bundle) mapper_.Finish();
}

Trajectory SlamSystem::FrameTrajectory() const {
  Trajectory trajectory;
  trajectory.reserve(tracked_.size());
  for (const TrackedFrame& frame : tracked_) {
    trajectory.push_back(
        {frame.timestamp_s, map_.PoseFromReference(frame.reference, frame.cam_from_reference).Inverse()});
  }
  return trajectory;
}

size_t SlamSystem::LiveFrameCount() const {
  return static_cast<size_t>(std::count_if(tracked_.begin(), tracked_.end(),
                                           [](const TrackedFrame& frame) { return frame.is_live; }));
}

Trajectory SlamSystem::KeyframeTrajectory() const {
  Trajectory trajectory;
  map_.keyframes().ForEach([&trajectory](const Keyframe& keyframe) {
    trajectory.push_back({keyframe.timestamp_s(), keyframe.cam_from_world().Inverse()});
  });
  return trajectory;
}

}  // namespace dynamic_slam
