#include "dynamic_slam/system/slam_system.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/stopwatch.h"
#include "dynamic_slam/base/thread_priority.h"
#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {
namespace {

class NoWork final : public cv::ParallelLoopBody {
 public:
  void operator()(const cv::Range&) const override {}
};

// Made before any thread: how OpenCV's threads take over what was made later, ThreadSanitizer does not see.
const NoWork no_work;

// The threads that OpenCV keeps for images serve the detector as well. Started by tracking, they would
// inherit its priority, and keep it.
void StartImageThreads() { cv::parallel_for_(cv::Range(0, 4 * std::max(1, cv::getNumThreads())), no_work); }

// In realtime mapping and the detector have a processor each.
OrbOptions WithThreads(OrbOptions orb, RunMode mode) {
  if (orb.threads > 0) return orb;
  constexpr int kMostThreads = 4;  // the finest level is a third of the work
  const int processors = cv::getNumberOfCPUs();
  orb.threads = std::clamp(mode == RunMode::kOffline ? processors : processors - 2, 1, kMostThreads);
  return orb;
}

const SystemOptions& Checked(const SystemOptions& options) {
  CheckOptions(options);
  return options;
}

}  // namespace

const char* Name(RunMode mode) { return mode == RunMode::kOffline ? "offline" : "realtime"; }

SlamSystem::SlamSystem(const Camera& raw_camera, const SystemOptions& options, RunMode mode)
    : SlamSystem(raw_camera, options, mode,
                 mode == RunMode::kOffline ? MakeInlineExecutor() : MakeThreadedExecutor()) {}

SlamSystem::SlamSystem(const Camera& raw_camera, const SystemOptions& options, RunMode mode,
                       std::unique_ptr<Executor> executor)
    : options_(Checked(options)),
      preparer_(raw_camera, options.image),
      mode_(mode),
      map_(OctaveScales(options.orb)),
      tracker_(camera(), WithThreads(options.orb, mode), options.tracker, options.dynamic, options.seed,
               &map_),
      back_end_(camera(), options_, &map_, executor.get()),
      tracked_(&map_),
      finisher_(camera(), options_, mode, &map_, &back_end_, &tracked_),
      executor_(std::move(executor)) {
  if (mode_ == RunMode::kRealtime) StartImageThreads();
}

// Tasks ask the executor what waits, so none may run any more when it goes.
SlamSystem::~SlamSystem() { executor_->Cancel(); }

FrameResult SlamSystem::Process(double timestamp_s, const cv::Mat& image, const cv::Mat& mask) {
  DS_TRACE("frame");
  DS_CHECK(!is_stopped_, "the system was stopped: Reset() first");
  ThrowIfFailed();
  const UrgentSection urgent(mode_ == RunMode::kRealtime);
  const auto start = std::chrono::steady_clock::now();
  const cv::Mat merged_mask = preparer_.MergedMask(mask);
  preparer_.Prepare(image, &grey_);
  try {
    return ProcessPrepared(timestamp_s, image, merged_mask, start);
  } catch (...) {
    failure_ = std::current_exception();
    throw;
  }
}

FrameResult SlamSystem::ProcessPrepared(double timestamp_s, const cv::Mat& image, const cv::Mat& mask,
                                        std::chrono::steady_clock::time_point start) {
  FrameResult result;
  result.id = FrameId(frame_count_++);
  double asking_ms = 0;  // inline, the detector itself
  if (detection_.has_value() && detection_->Begin(result.id, timestamp_s)) {
    const bool reads_pixels = detection_->detector().ReadsPixels();
    if (reads_pixels) preparer_.PrepareColour(image, &colour_);
    const auto asked = std::chrono::steady_clock::now();
    detection_->Submit(result.id, timestamp_s, reads_pixels ? colour_ : grey_);
    asking_ms = MillisecondsSince(asked);
  }
  tracker_.Extract(result.id, timestamp_s, grey_, mask);
  if (detection_.has_value()) {
    result.objects =
        detection_->Collect(result.id, timestamp_s, tracker_.PredictedRotation(), tracker_.Motions());
  }
  result.tracking = tracker_.Track(result.objects, executor_->Waiting(Lane::kMapping));
  if (const auto rotation = tracker_.Rotation(); rotation.has_value() && detection_.has_value()) {
    detection_->SetRotation(result.id, *rotation);
  }
  result.tracking_ms = MillisecondsSince(start) - asking_ms;

  Remember(result);
  for (const KeyframeId keyframe : result.tracking.new_keyframes) {
    back_end_.PostMapping(keyframe, result.tracking.map_epoch);
  }
  back_end_.PostLoops();
  result.keyframes_waiting = executor_->Waiting(Lane::kMapping);
  TraceCounter("keyframes waiting", result.keyframes_waiting);
  return result;
}

void SlamSystem::ThrowIfFailed() const {
  if (failure_ != nullptr) std::rethrow_exception(failure_);
  executor_->ThrowIfFailed();
}

void SlamSystem::Remember(const FrameResult& result) {
  const TrackingResult& tracking = result.tracking;
  const Frame& frame = tracker_.frame();
  for (int i = 0; i < tracking.withdrawn; ++i) tracked_.RemoveLast();
  if (tracking.part_was_erased) tracked_.RemoveThoseOfErasedParts();
  if (tracking.state == TrackingState::kTracking) {
    if (options_.backfill) {
      for (const AnchoredPose& earlier : tracking.earlier_frames) tracked_.Add(earlier, false);
    }
    tracked_.Add({frame.timestamp_s, frame.reference, frame.cam_from_reference}, true);
  }
  finisher_.Remember(frame, tracking, grey_);
}

BundleSummary SlamSystem::Finish(const std::function<bool()>& should_stop) {
  if (is_stopped_) return {};
  ThrowIfFailed();
  back_end_.Drain();
  return finisher_.Finish(should_stop);
}

void SlamSystem::SetDetector(std::shared_ptr<Detector> detector) {
  DS_CHECK(frame_count_ == 0, "frames={}", frame_count_);
  detection_.reset();
  if (detector != nullptr) {
    detector->SetPreparation(preparer_.box_mapping());
    detection_.emplace(std::move(detector), options_.detector, camera(), executor_.get());
  }
}

void SlamSystem::LoadMap(SavedMap saved, const std::string& name) {
  DS_CHECK(frame_count_ == 0, "frames={}", frame_count_);
  CheckMapFits(saved, camera(), OctaveScales(options_.orb), name);
  saved.map.landmarks().ForEach([](Landmark& landmark) {
    // Many sightings of an earlier visit say no more of this one than a few.
    constexpr int kMaxSightings = 10;
    if (landmark.visible_count <= kMaxSightings) return;
    landmark.found_count = static_cast<int>(std::lround(kMaxSightings * landmark.FoundRatio()));
    landmark.visible_count = kMaxSightings;
  });
  map_.Write()->Replace(std::move(saved.map));
  tracker_.ExpectKnownPlace();
}

void SlamSystem::SetLocaliseOnly(bool localise_only) {
  back_end_.Drain();
  if (localise_only && map_.Read()->keyframes().size() == 0) {
    throw InputError("localise_only", "there is no map to localise in", "Load one, or make one first.");
  }
  options_.tracker.localise_only = localise_only;
  tracker_.SetLocaliseOnly(localise_only);
}

void SlamSystem::Stop() {
  executor_->Cancel();
  is_stopped_ = true;
}

void SlamSystem::Reset() {
  executor_->Cancel();
  tracker_.Reset();
  if (detection_.has_value()) detection_->Reset();
  colour_.release();  // a detector that hangs may still read it
  tracked_.Clear();
  finisher_.Clear();
  back_end_.Restore({});
  frame_count_ = 0;
  failure_ = nullptr;
  is_stopped_ = false;
}

PartId SlamSystem::OrMain(PartId part) const {
  if (part.IsValid()) return part;
  const std::vector<PartId> parts = Parts();
  return parts.empty() ? PartId() : parts.front();
}

Trajectory SlamSystem::FrameTrajectory(PartId part) const { return tracked_.PathOf(OrMain(part)); }

Trajectory SlamSystem::KeyframeTrajectory(PartId part) const {
  part = OrMain(part);
  Trajectory trajectory;
  map_.Read()->keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != part || !keyframe.frame_id().IsValid()) return;
    trajectory.push_back({keyframe.timestamp_s(), keyframe.cam_from_world().Inverse()});
  });
  // Some may have become keyframes after later ones.
  std::sort(trajectory.begin(), trajectory.end(),
            [](const StampedPose& a, const StampedPose& b) { return a.timestamp_s < b.timestamp_s; });
  return trajectory;
}

}  // namespace dynamic_slam
