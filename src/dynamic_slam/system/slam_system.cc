#include "dynamic_slam/system/slam_system.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <set>
#include <utility>

#include <opencv2/core/utility.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/thread_priority.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/mapping/map_bundle.h"
#include "dynamic_slam/mapping/path_bundle.h"
#include "dynamic_slam/system/leap_mender.h"
#include "dynamic_slam/tracking/revisit_finder.h"

namespace dynamic_slam {
namespace {

// Longer parts, ten seconds, have a scale of their own; to try takes as long as to track them.
constexpr size_t kMostGrownOver = 300;

// So often the map is adjusted to what frames see of it: then they see more. Crowd 22 errs by 0.0125 m
// without, by 0.0110, 0.0103, 0.0099 after one, two, three.
constexpr int kViewRounds = 2;

double MillisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

// Whether the part has keyframes of a map that was loaded.
bool IsFromFile(const Map& map, PartId part) {
  bool is_from_file = false;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    is_from_file |= keyframe.part() == part && !keyframe.frame_id().IsValid();
  });
  return is_from_file;
}

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
      mapper_(camera(), options.mapper, &map_),
      loop_closer_(camera(), options.loop, options.seed, &map_),
      tracked_(&map_),
      bridge_finder_(camera(), options.tracker, &map_),
      executor_(std::move(executor)) {
  if (mode_ == RunMode::kRealtime) StartImageThreads();
  if (mode_ == RunMode::kOffline && options_.backfill) {
    backfiller_.emplace(camera(), options_.tracker, options_.seed, &map_);
  }
  if (mode_ == RunMode::kOffline && options_.refine_poses) {
    refiner_.emplace(camera(), options_.tracker, &map_);
  }
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
    PostMapping(keyframe, result.tracking.map_epoch);
  }
  PostLoops();
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
  if (tracking.last_was_withdrawn) {
    tracked_.RemoveLast();
    if (backfiller_.has_value()) backfiller_->LastWasWithdrawn();
  }
  if (tracking.part_was_erased) {
    tracked_.RemoveThoseOfErasedParts();
    if (backfiller_.has_value()) backfiller_->PartWasErased();
  }
  const bool has_pose = tracking.state == TrackingState::kTracking;
  if (has_pose) {
    if (options_.backfill) {
      for (const AnchoredPose& earlier : tracking.earlier_frames) tracked_.Add(earlier, false);
    }
    tracked_.Add({frame.timestamp_s, frame.reference, frame.cam_from_reference}, true);
  }
  if (refiner_.has_value() && !options_.tracker.localise_only) refiner_->Keep(frame, tracking.min_inliers);
  if (!backfiller_.has_value()) return;
  if (!has_pose || tracking.is_provisional) {
    backfiller_->Keep(frame, tracking.min_inliers, has_pose);
  } else {
    backfiller_->ForgetPosed();
  }
}

void SlamSystem::PostMapping(KeyframeId keyframe, uint32_t epoch) {
  executor_->Post(Lane::kMapping, [this, keyframe, epoch](const std::stop_token& token) {
    MapKeyframe(keyframe, epoch, token);
  });
}

void SlamSystem::MapKeyframe(KeyframeId keyframe, uint32_t epoch, const std::stop_token& token) {
  const auto start = std::chrono::steady_clock::now();
  const MappingResult result = mapper_.Process(keyframe, epoch, [this, &token] {
    return token.stop_requested() ||
           executor_->Waiting(Lane::kMapping) >= options_.mapper.interrupting_keyframes;
  });
  if (options_.loop.enabled && !result.abandoned) mapped_.Write()->push_back({keyframe, epoch});
  auto report = mapping_report_.Write();
  report->times_ms.push_back(MillisecondsSince(start));
  report->landmarks_created += result.created;
  report->landmarks_culled += result.culled_landmarks;
  report->landmarks_merged += result.merged_landmarks;
  report->keyframes_culled += result.culled_keyframes;
  report->bundles_stopped += result.bundle.stopped;
  report->keyframes_abandoned += result.abandoned;
}

void SlamSystem::PostLoops() {
  std::vector<MappedKeyframe> mapped;
  std::swap(mapped, *mapped_.Write());
  for (const MappedKeyframe& keyframe : mapped) {
    executor_->Post(Lane::kLoop,
                    [this, keyframe](const std::stop_token& token) { CloseLoop(keyframe, token); });
  }
}

void SlamSystem::CloseLoop(const MappedKeyframe& keyframe, const std::stop_token& token) {
  const auto start = std::chrono::steady_clock::now();
  const auto should_stop = [&token] { return token.stop_requested(); };
  FinishLoop(loop_closer_.Process(keyframe.id, keyframe.epoch, should_stop), start, should_stop);
}

void SlamSystem::FinishLoop(const LoopResult& result, std::chrono::steady_clock::time_point start,
                            const std::function<bool()>& should_stop) {
  std::optional<BundleSummary> bundle;
  if (result.corrected && options_.loop.full_bundle) {
    bundle = AdjustAll(camera(), options_.mapper, should_stop, &map_);
  }
  auto report = loop_report_.Write();
  report->attempts.insert(report->attempts.end(), result.attempts.begin(), result.attempts.end());
  report->linked += result.linked && !result.corrected;
  report->corrected += result.corrected;
  report->joined += result.joined;
  report->landmarks_merged += result.landmarks_merged;
  report->bundles += bundle.has_value();
  report->bundles_stopped += bundle.has_value() && bundle->stopped;
  report->times_ms.push_back(MillisecondsSince(start));
}

void SlamSystem::DrainMapping() {
  executor_->Drain(Lane::kMapping);
  PostLoops();
  executor_->Drain(Lane::kLoop);
}

BundleSummary SlamSystem::Finish(const std::function<bool()>& should_stop) {
  DS_TRACE("finish");
  if (is_stopped_) return {};
  ThrowIfFailed();
  DrainMapping();
  const bool changes_map = !options_.tracker.localise_only;
  if (backfiller_.has_value() && options_.backfill_grows_map && changes_map) {
    tracked_.AddFound(Backfill(tracked_.Poses(), true, should_stop));
    DrainMapping();
    if (options_.loop.enabled) CloseBorders(should_stop);
    if (refiner_.has_value()) GrowOverParts(should_stop);
    if (options_.loop.enabled) JoinAlikeParts(should_stop);
  }
  const bool adjusts = options_.final_bundle && changes_map;
  BundleSummary bundle;
  if (adjusts) {
    bundle = mapper_.Finish(should_stop);
    if (options_.loop.enabled && LinkRevisits(should_stop)) bundle = mapper_.Finish(should_stop);
  }
  if (backfiller_.has_value()) tracked_.AddFound(Backfill(tracked_.Poses(), false, should_stop));
  if (refiner_.has_value() && changes_map) {
    MotionNoises noises;
    if (adjusts) RefineMap(should_stop, &noises);
    RefinePath(noises, should_stop);
    // Without the frames between nobody knows whether the path leaps.
    if (backfiller_.has_value()) {
      LeapMender mender(camera(), options_.tracker, options_.seed, *refiner_, &tracked_, &map_);
      pieces_cut_ = mender.CutOffSides(should_stop) + mender.MendEnds(should_stop);
      if (pieces_cut_ > 0) RefinePath(noises, should_stop);
    }
  }
  if (Smooths()) tracked_.Smooth(should_stop);
  return bundle;
}

std::vector<AnchoredPose> SlamSystem::Backfill(std::span<const AnchoredPose> known, bool grows,
                                               const std::function<bool()>& should_stop) {
  const uint32_t epoch = map_.Read()->epoch();
  const auto map_keyframe = [this, epoch](KeyframeId keyframe) {
    PostMapping(keyframe, epoch);
    executor_->Drain(Lane::kMapping);
  };
  return grows ? backfiller_->Grow(known, map_keyframe, should_stop) : backfiller_->Find(known, should_stop);
}

void SlamSystem::CloseBorders(const std::function<bool()>& should_stop) {
  std::vector<AnchoredPose> poses = tracked_.Poses();
  const std::vector<AnchoredPose> found = backfiller_->Find(poses, should_stop);
  poses.insert(poses.end(), found.begin(), found.end());
  const KnownPoses known(poses, &map_);
  const uint32_t epoch = map_.Read()->epoch();
  for (const BridgeFinder::Border& border : bridge_finder_.Borders(known)) {
    if (should_stop && should_stop()) return;
    if (!bridge_finder_.IsOpen(border)) continue;  // by now
    const auto start = std::chrono::steady_clock::now();
    const Bridge bridge = bridge_finder_.Find(known, border);
    Loop loop{bridge.keyframe, bridge.neighbour, bridge.keyframe_from_neighbour, {}, {}};
    for (const auto& [keypoint, landmark] : bridge.links) loop.links.push_back({keypoint, landmark});
    LoopAttempt attempt;
    attempt.matches = bridge.common;
    attempt.drift_px = bridge.drift_px;
    attempt.reason = bridge.reason;
    FinishLoop(loop_closer_.Join(loop, attempt, epoch, should_stop), start, should_stop);
  }
}

void SlamSystem::GrowOverParts(const std::function<bool()>& should_stop) {
  for (const PartId part : tracked_.Parts()) {
    if (should_stop && should_stop()) return;
    const PartId main = tracked_.Parts().front();
    if (part == main || IsFromFile(*map_.Read(), part)) continue;
    std::set<double> stamps;
    for (const StampedPose& pose : tracked_.PathOf(part)) stamps.insert(pose.timestamp_s);
    if (stamps.empty() || stamps.size() > kMostGrownOver) continue;
    const auto is_shared = [&](const AnchoredPose& pose) { return stamps.contains(pose.timestamp_s); };
    // For a trial, as most of what nothing joined is elsewhere.
    const Map map = *map_.Read();
    const MappingReport mapping_report = *mapping_report_.Read();
    const LoopReport loop_report = *loop_report_.Read();
    const auto undo = [&] {
      map_.Write()->Replace(Map(map));
      *mapping_report_.Write() = mapping_report;
      *loop_report_.Write() = loop_report;
      mapped_.Write()->clear();
    };
    map_.Write()->ErasePart(part);
    std::vector<AnchoredPose> found = GrowOver(stamps, should_stop);
    const bool is_whole = !should_stop || !should_stop();
    if (is_whole && tracked_.HasNearlyAll(main, stamps, found)) {
      tracked_.RemoveThoseOfErasedParts();
    } else {
      undo();
      if (!is_whole || std::none_of(found.begin(), found.end(), is_shared)) continue;
      backfiller_->Ignore(part);
      found = GrowOver(stamps, should_stop);
      backfiller_->Ignore({});
      if (!JoinBySharedFrames(stamps, should_stop)) {
        undo();
        continue;
      }
      std::erase_if(found, is_shared);
    }
    tracked_.AddFound(found);
    DrainMapping();
  }
}

std::vector<AnchoredPose> SlamSystem::GrowOver(const std::set<double>& stamps,
                                               const std::function<bool()>& should_stop) {
  refiner_->GiveTo(&*backfiller_, stamps);
  std::vector<AnchoredPose> known = tracked_.PosesBut(stamps), found;
  for (const bool grows : {true, false}) {
    const std::vector<AnchoredPose> now = Backfill(known, grows, should_stop);
    known.insert(known.end(), now.begin(), now.end());
    found.insert(found.end(), now.begin(), now.end());
  }
  return found;
}

bool SlamSystem::JoinBySharedFrames(const std::set<double>& stamps,
                                    const std::function<bool()>& should_stop) {
  const std::vector<MappedKeyframe> grown = *mapped_.Read();
  return std::any_of(grown.begin(), grown.end(), [&](const MappedKeyframe& mapped) {
    {
      const auto map = map_.Read();
      const Keyframe* keyframe = map->keyframes().Find(mapped.id);
      if (keyframe == nullptr || !stamps.contains(keyframe->timestamp_s())) return false;
    }
    const auto start = std::chrono::steady_clock::now();
    const LoopResult result = loop_closer_.ProcessNow(mapped.id, mapped.epoch, should_stop);
    FinishLoop(result, start, should_stop);
    return result.joined;
  });
}

void SlamSystem::JoinAlikeParts(const std::function<bool()>& should_stop) {
  for (const PartId part : tracked_.Parts()) {
    if (should_stop && should_stop()) return;
    const PartId main = tracked_.Parts().front();
    if (part == main) continue;
    const auto start = std::chrono::steady_clock::now();
    FinishLoop(loop_closer_.JoinAlike(part, main, should_stop), start, should_stop);
  }
}

bool SlamSystem::LinkRevisits(const std::function<bool()>& should_stop) {
  const int links = RevisitFinder(camera(), options_.tracker, &map_).LinkAll(should_stop);
  loop_report_.Write()->revisit_links = links;
  return links > 0;
}

void SlamSystem::RefineMap(const std::function<bool()>& should_stop, MotionNoises* noises) {
  for (int round = 0; round < kViewRounds; ++round) {
    std::vector<FrameView> views;
    tracked_.Replace(refiner_->Refine(tracked_.Poses(), should_stop, &views));
    if (views.empty() && !options_.mapper.motion_prior) return;  // keyframes tell all
    const PathEvidence path{views, noises};
    if (!AdjustAll(camera(), options_.mapper, should_stop, &map_, &path).usable) return;
  }
}

void SlamSystem::RefinePath(const MotionNoises& noises, const std::function<bool()>& should_stop) {
  const std::vector<AnchoredPose> before = tracked_.Poses();
  const bool adjusts = Smooths() && options_.mapper.motion_prior;
  std::vector<FrameView> views;
  const std::vector<AnchoredPose> found =
      refiner_->Refine(before, should_stop, adjusts ? &views : nullptr, PoseRefiner::ViewsOf::kAll);
  tracked_.Replace(found);
  if (should_stop && should_stop()) return;  // not all were looked for
  const std::set<double> refuted = refiner_->Refuted(before, found);
  tracked_.Remove(refuted);
  frames_refuted_ += refuted.size();
  if (!adjusts) return;
  AdjustPath(camera(), options_.mapper.final_bundle, noises, should_stop, &map_, &views);
  tracked_.Move(views);
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
  DrainMapping();
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
  pieces_cut_ = 0;
  frames_refuted_ = 0;
  if (backfiller_.has_value()) backfiller_->Clear();
  if (refiner_.has_value()) refiner_->Clear();
  *mapping_report_.Write() = MappingReport();
  *loop_report_.Write() = LoopReport();
  mapped_.Write()->clear();
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
