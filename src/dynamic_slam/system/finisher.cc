#include "dynamic_slam/system/finisher.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/geometry/path_roughness.h"
#include "dynamic_slam/mapping/map_bundle.h"
#include "dynamic_slam/mapping/path_bundle.h"
#include "dynamic_slam/system/leap_mender.h"
#include "dynamic_slam/tracking/known_poses.h"
#include "dynamic_slam/tracking/revisit_finder.h"

namespace dynamic_slam {
namespace {

// Longer parts, ten seconds, have a scale of their own; to try takes as long as to track them.
constexpr size_t kMostGrownOver = 300;

// So often the map is adjusted to what frames see of it: then they see more. Crowd 22 errs by 0.0125 m
// without, by 0.0110, 0.0103, 0.0099 after one, two, three.
constexpr int kViewRounds = 2;

// So often the map is linked to what it has of other times, while more is found: links move it to where they
// are looked for. Followers 21 err by 0.0098 m after one, by 0.0064 after three; most find none in the third.
constexpr int kLinkRounds = 3;

// Whether the part has keyframes of a map that was loaded.
bool IsFromFile(const Map& map, PartId part) {
  bool is_from_file = false;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    is_from_file |= keyframe.part() == part && !keyframe.frame_id().IsValid();
  });
  return is_from_file;
}

// Of two paths of the same frames: whether one has more of them, and is not rougher by as much.
bool IsBetter(const Trajectory& path, const Trajectory& than) {
  // What lacks a few frames must be clearly the steadier: where the map no longer grew it had gone astray.
  constexpr double kWeightOfFrames = 6;
  const auto [roughness, other_roughness] = RoughnessWhereTheyDiffer(path, than);
  const double frames = static_cast<double>(path.size()), others = static_cast<double>(than.size());
  if (!(roughness > 0 && other_roughness > 0)) return frames > others;
  return std::pow(frames / others, kWeightOfFrames) > roughness / other_roughness;
}

}  // namespace

Finisher::Finisher(const Camera& camera, const SystemOptions& options, RunMode mode, SharedMap* map,
                   BackEnd* back_end, TrackedFrames* tracked)
    : camera_(camera),
      options_(options),
      mode_(mode),
      map_(map),
      back_end_(back_end),
      tracked_(tracked),
      bridge_finder_(camera, options.tracker, map) {
  if (mode_ != RunMode::kOffline) return;
  if (options_.backfill) backfiller_.emplace(camera_, options_.tracker, options_.seed, map_);
  if (options_.refine_poses) refiner_.emplace(camera_, options_.tracker, map_);
  if (options_.refine_poses && options_.align_sightings) aligner_.emplace(camera_, map_);
}

void Finisher::Remember(const Frame& frame, const TrackingResult& tracking, const cv::Mat& grey) {
  const bool has_pose = tracking.state == TrackingState::kTracking;
  if (refiner_.has_value() && ChangesMap()) refiner_->Keep(frame, tracking.min_inliers);
  if (aligner_.has_value() && ChangesMap()) aligner_->Keep(frame.timestamp_s, grey);
  if (!backfiller_.has_value()) return;
  backfiller_->LastWereWithdrawn(tracking.withdrawn);
  if (tracking.part_was_erased) backfiller_->PartWasErased();
  if (!has_pose || tracking.is_provisional) {
    backfiller_->Keep(frame, tracking.min_inliers, has_pose);
  } else {
    backfiller_->ForgetPosed();
  }
}

void Finisher::Clear() {
  if (backfiller_.has_value()) backfiller_->Clear();
  if (refiner_.has_value()) refiner_->Clear();
  if (aligner_.has_value()) aligner_->Clear();
  back_end_->mapper().SetCullsKeyframes(true);  // in case Finish threw
  pieces_cut_ = 0;
  frames_refuted_ = 0;
  lens_doubt_.reset();
}

Finisher::State Finisher::Save() const {
  Map map = *map_->Read();
  return {std::move(map),       *tracked_,   backfiller_->Stamps(),
          back_end_->reports(), pieces_cut_, frames_refuted_};
}

void Finisher::Restore(State state) {
  map_->Write()->Replace(std::move(state.map));
  *tracked_ = std::move(state.tracked);
  backfiller_->KeepOnly(state.backfilled);
  back_end_->Restore(state.reports);
  pieces_cut_ = state.pieces_cut;
  frames_refuted_ = state.frames_refuted;
}

Trajectory Finisher::MainPath() const {
  const std::vector<PartId> parts = tracked_->Parts();
  return parts.empty() ? Trajectory() : tracked_->PathOf(parts.front());
}

SightingAligner::Motions Finisher::Motions() const {
  SightingAligner::Motions motions;
  if (!(camera_.readout_s > 0)) return motions;
  for (const PartId part : tracked_->Parts()) motions[part] = MotionsAlong(tracked_->SmoothPathOf(part));
  return motions;
}

BundleSummary Finisher::Finish(const std::function<bool()>& should_stop) {
  DS_TRACE("finish");
  const auto is_stopped = [&should_stop] { return should_stop && should_stop(); };
  const bool grows = MayGrow() && backfiller_->PlanGrowth(tracked_->Poses(), should_stop);
  std::optional<State> before;
  if (grows && options_.grow_twice) before = Save();
  const BundleSummary bundle = Complete(grows, should_stop);
  const bool aligned = MayAlign(should_stop);
  const bool is_done_twice = before.has_value() && back_end_->mapping_report().keyframes_culled !=
                                                       before->reports.mapping.keyframes_culled;
  std::optional<State> completed;
  if (is_done_twice && aligned) completed = Save();
  Refine(aligned, should_stop);
  if (!is_done_twice || is_stopped()) return bundle;
  State first = Save();

  // Keypoints alone tell which way is right: where they are aligned, both are steady.
  if (aligned) {
    Restore(std::move(*completed));
    Refine(false, should_stop);
  }
  const Trajectory first_path = MainPath();
  Restore(std::move(*before));
  backfiller_->PlanGrowth(tracked_->Poses(), should_stop);
  back_end_->mapper().SetCullsKeyframes(false);
  const BundleSummary second_bundle = Complete(true, should_stop);
  back_end_->mapper().SetCullsKeyframes(true);
  if (aligned) completed = Save();
  Refine(false, should_stop);
  const bool is_better = IsBetter(MainPath(), first_path);
  if (is_better && aligned) {
    Restore(std::move(*completed));
    Refine(true, should_stop);
  }
  if (is_better && !is_stopped()) return second_bundle;
  Restore(std::move(first));
  return bundle;
}

bool Finisher::MayAlign(const std::function<bool()>& should_stop) {
  if (!aligner_.has_value() || !ChangesMap() || (should_stop && should_stop())) return false;
  DS_TRACE("finish/lens");
  const auto map = map_->Read();
  if (map->Parts().empty()) return false;
  const std::optional<SelfCalibration> found = CalibrateLensByMap(camera_, *map);
  if (found.has_value() && found->lens_gain > kNotableLensGain) lens_doubt_ = found;
  return !lens_doubt_.has_value();
}

BundleSummary Finisher::Complete(bool grows, const std::function<bool()>& should_stop) {
  if (MayGrow()) {
    if (grows) tracked_->AddFound(Grow(tracked_->Poses(), should_stop));
    back_end_->Drain();
    if (options_.loop.enabled) CloseBorders(should_stop);
    if (refiner_.has_value()) GrowOverParts(should_stop);
    if (options_.loop.enabled) JoinAlikeParts(should_stop);
  }
  BundleSummary bundle;
  if (AdjustsMap()) {
    bundle = back_end_->mapper().Finish(should_stop);
    if (options_.loop.enabled) LinkRevisits(should_stop, &bundle);
  }
  if (backfiller_.has_value()) tracked_->AddFound(backfiller_->Find(tracked_->Poses(), should_stop));
  return bundle;
}

void Finisher::Refine(bool aligned, const std::function<bool()>& should_stop) {
  if (refiner_.has_value() && ChangesMap()) {
    MotionNoises noises;
    if (AdjustsMap()) RefineMap(aligned, should_stop, &noises);
    RefinePath(aligned, noises, should_stop);
    // Without the frames between nobody knows whether the path leaps.
    if (backfiller_.has_value()) {
      LeapMender mender(camera_, options_.tracker, options_.seed, *refiner_, tracked_, map_);
      pieces_cut_ = mender.CutOffSides(should_stop) + mender.MendEnds(should_stop);
      if (pieces_cut_ > 0) RefinePath(aligned, noises, should_stop);
    }
  }
  if (Smooths()) tracked_->Smooth(should_stop);
}

std::vector<AnchoredPose> Finisher::Grow(std::span<const AnchoredPose> known,
                                         const std::function<bool()>& should_stop) {
  const uint32_t epoch = map_->Read()->epoch();
  const auto map_keyframe = [this, epoch](KeyframeId keyframe) {
    back_end_->PostMapping(keyframe, epoch);
    back_end_->DrainMapping();
  };
  return backfiller_->Grow(known, map_keyframe, should_stop);
}

void Finisher::CloseBorders(const std::function<bool()>& should_stop) {
  std::vector<AnchoredPose> poses = tracked_->Poses();
  const std::vector<AnchoredPose> found = backfiller_->Find(poses, should_stop);
  poses.insert(poses.end(), found.begin(), found.end());
  const KnownPoses known(poses, map_);
  const uint32_t epoch = map_->Read()->epoch();
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
    back_end_->FinishLoop(back_end_->loop_closer().Join(loop, attempt, epoch, should_stop), start,
                          should_stop);
  }
}

void Finisher::GrowOverParts(const std::function<bool()>& should_stop) {
  for (const PartId part : tracked_->Parts()) {
    if (should_stop && should_stop()) return;
    const PartId main = tracked_->Parts().front();
    if (part == main || IsFromFile(*map_->Read(), part)) continue;
    std::set<double> stamps;
    for (const StampedPose& pose : tracked_->PathOf(part)) stamps.insert(pose.timestamp_s);
    if (stamps.empty() || stamps.size() > kMostGrownOver) continue;
    const auto is_shared = [&](const AnchoredPose& pose) { return stamps.contains(pose.timestamp_s); };
    // For a trial, as most of what nothing joined is elsewhere.
    const Map map = *map_->Read();
    const BackEndReports reports = back_end_->reports();
    const auto undo = [&] {
      map_->Write()->Replace(Map(map));
      back_end_->Restore(reports);
    };
    map_->Write()->ErasePart(part);
    std::vector<AnchoredPose> found = GrowOver(stamps, should_stop);
    const bool is_whole = !should_stop || !should_stop();
    if (is_whole && tracked_->HasNearlyAll(main, stamps, found)) {
      tracked_->RemoveThoseOfErasedParts();
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
    tracked_->AddFound(found);
    back_end_->Drain();
  }
}

std::vector<AnchoredPose> Finisher::GrowOver(const std::set<double>& stamps,
                                             const std::function<bool()>& should_stop) {
  refiner_->GiveTo(&*backfiller_, stamps);
  std::vector<AnchoredPose> known = tracked_->PosesBut(stamps), found;
  const auto add = [&](const std::vector<AnchoredPose>& now) {
    known.insert(known.end(), now.begin(), now.end());
    found.insert(found.end(), now.begin(), now.end());
  };
  if (backfiller_->PlanGrowth(known, should_stop)) add(Grow(known, should_stop));
  add(backfiller_->Find(known, should_stop));
  return found;
}

bool Finisher::JoinBySharedFrames(const std::set<double>& stamps, const std::function<bool()>& should_stop) {
  const std::vector<BackEnd::MappedKeyframe> grown = back_end_->mapped();
  return std::any_of(grown.begin(), grown.end(), [&](const BackEnd::MappedKeyframe& mapped) {
    {
      const auto map = map_->Read();
      const Keyframe* keyframe = map->keyframes().Find(mapped.id);
      if (keyframe == nullptr || !stamps.contains(keyframe->timestamp_s())) return false;
    }
    const auto start = std::chrono::steady_clock::now();
    const LoopResult result = back_end_->loop_closer().ProcessNow(mapped.id, mapped.epoch, should_stop);
    back_end_->FinishLoop(result, start, should_stop);
    return result.joined;
  });
}

void Finisher::JoinAlikeParts(const std::function<bool()>& should_stop) {
  for (const PartId part : tracked_->Parts()) {
    if (should_stop && should_stop()) return;
    const PartId main = tracked_->Parts().front();
    if (part == main) continue;
    const auto start = std::chrono::steady_clock::now();
    back_end_->FinishLoop(back_end_->loop_closer().JoinAlike(part, main, should_stop), start, should_stop);
  }
}

void Finisher::LinkRevisits(const std::function<bool()>& should_stop, BundleSummary* bundle) {
  int links = 0;
  for (int round = 0; round < kLinkRounds; ++round) {
    const int found = RevisitFinder(camera_, options_.tracker, map_).LinkAll(should_stop);
    if (found == 0) break;
    links += found;
    *bundle = back_end_->mapper().Finish(should_stop);
  }
  back_end_->ReportRevisits(links);
}

void Finisher::RefineMap(bool aligned, const std::function<bool()>& should_stop, MotionNoises* noises) {
  for (int round = 0; round < kViewRounds; ++round) {
    std::vector<FrameView> views;
    tracked_->Replace(refiner_->Refine(tracked_->Poses(), should_stop, &views));
    if (views.empty() && !options_.mapper.motion_prior) return;  // keyframes tell all
    PathEvidence path{views, noises};
    if (aligned) path.aligned = aligner_->Align(Motions(), should_stop, &views);
    if (!AdjustAll(camera_, options_.mapper, should_stop, map_, &path).usable) return;
  }
}

void Finisher::RefinePath(bool aligned, const MotionNoises& noises,
                          const std::function<bool()>& should_stop) {
  const std::vector<AnchoredPose> before = tracked_->Poses();
  const bool adjusts = Smooths() && options_.mapper.motion_prior;
  std::vector<FrameView> views;
  const std::vector<AnchoredPose> found =
      refiner_->Refine(before, should_stop, adjusts ? &views : nullptr, PoseRefiner::ViewsOf::kAll);
  tracked_->Replace(found);
  if (should_stop && should_stop()) return;  // not all were looked for
  const std::set<double> refuted = refiner_->Refuted(before, found);
  tracked_->Remove(refuted);
  frames_refuted_ += refuted.size();
  if (!adjusts) return;
  if (aligned) aligner_->AlignViews(Motions(), should_stop, &views);
  AdjustPath(camera_, options_.mapper.final_bundle, noises, should_stop, map_, &views);
  tracked_->Move(views);
}

}  // namespace dynamic_slam
