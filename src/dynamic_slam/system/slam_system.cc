#include "dynamic_slam/system/slam_system.h"

#include <algorithm>
#include <chrono>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"

namespace dynamic_slam {
namespace {

double MillisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

const SystemOptions& Checked(const SystemOptions& options) {
  CheckOptions(options);
  return options;
}

}  // namespace

SlamSystem::SlamSystem(const Camera& raw_camera, const SystemOptions& options)
    : options_(Checked(options)),
      preparer_(raw_camera, options.image),
      map_(OctaveScales(options.orb)),
      tracker_(camera(), options.orb, options.tracker, options.seed, &map_),
      mapper_(camera(), options.mapper, &map_) {}

FrameResult SlamSystem::Process(double timestamp_s, const cv::Mat& image, const cv::Mat& mask) {
  FrameResult result;
  auto start = std::chrono::steady_clock::now();
  preparer_.Prepare(image, &grey_);
  result.id = FrameId(frame_count_++);
  result.tracking = tracker_.Track(result.id, timestamp_s, grey_, preparer_.MergedMask(mask));
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
