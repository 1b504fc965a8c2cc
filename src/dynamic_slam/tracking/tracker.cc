#include "dynamic_slam/tracking/tracker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {
namespace {

// When the motion model fails the camera may have jerked: look this much farther once more.
constexpr double kWideSearch = 3.0;

// A motion is not carried on for longer than so many times the time in which it was seen.
constexpr double kMaxPredictionSteps = 5;

// Who saw nothing for so many frames, half a second, may be anywhere.
constexpr int kMostDarkFrames = 15;

// An uncertain start is believed after so many frames without a better one.
constexpr uint32_t kMaxReviews = 60;

// Whether two motions from the same view are one, the scale of the translation apart. Rivals differ by more.
bool Agree(const Rigid3& a, const Rigid3& b) {
  constexpr double kMaxRotationRad = 0.02, kMinDirectionCosine = 0.95;
  return RotationAngle(a.rotation, b.rotation) < kMaxRotationRad &&
         a.translation.normalized().dot(b.translation.normalized()) > kMinDirectionCosine;
}

}  // namespace

Tracker::Tracker(const Camera& camera, const OrbOptions& orb, const TrackerOptions& options,
                 const DynamicOptions& dynamic, uint64_t seed, SharedMap* map)
    : camera_(camera),
      orb_options_(orb),
      options_(options),
      map_(map),
      octave_scales_(map->Read()->octave_scales()),
      extractor_(orb, camera),
      shutter_(camera),
      initializer_(camera, options.initializer, octave_scales_),
      localiser_(camera, options, octave_scales_, map),
      filter_(camera, dynamic, octave_scales_),
      flow_(camera, octave_scales_),
      seeds_(camera, octave_scales_),
      seed_(seed),
      random_(seed) {}

void Tracker::Extract(FrameId id, double timestamp_s, const cv::Mat& grey, const cv::Mat& mask) {
  image_interval_s_ = timestamp_s - frame_.timestamp_s;
  follows_nothing_ = shows_nothing_;
  if (!shows_nothing_) std::swap(frame_, last_);
  shows_nothing_ = false;
  frame_.id = id;
  frame_.timestamp_s = timestamp_s;
  const bool is_starting = state_ == TrackingState::kInitialising || !start_is_certain_;
  double factor = is_starting ? options_.initializer.feature_factor : 1.0;
  if (filter_.options().more_features) {
    factor = std::max(factor, std::min(1 / (1 - share_in_boxes_), filter_.options().max_feature_factor));
    LookBesideBoxes();
  }
  extractor_.SetFeatures(static_cast<int>(factor * orb_options_.features));
  extractor_.Extract(grey, mask, &frame_.features);
  frame_.static_probability.clear();
  frame_.ClearLandmarks();
  const std::optional<Rigid3> motion = PredictMotion(frame_.timestamp_s - last_.timestamp_s);
  shutter_.Expect(motion, last_, &frame_);
  frame_.reference = last_.reference;
  frame_.reference_unit = 1;
  DS_TRACE("tracking/flow");
  // A start needs all that moves as what is at rest does.
  flow_.Match(last_, filter_.Boxes(), motion ? std::optional(motion->rotation) : std::nullopt, frame_,
              last_has_pose_ ? KeypointFlow::Of::kWitnesses : KeypointFlow::Of::kAll);
}

// Where people fill the view, their clothes have more and stronger corners than the ceiling and the floor,
// and would take all the places. Only until there is a pose: then it tells what is at rest in boxes, and with
// weak corners some paths went wrong (docs/benchmarks.md).
void Tracker::LookBesideBoxes() {
  const auto are_few = [&] {
    size_t usable = 0;
    for (size_t i = 0; i < last_.features.size(); ++i) {
      usable += last_.StaticProbability(i) >= kMinStaticProbability ? 1 : 0;
    }
    return usable < static_cast<size_t>(orb_options_.features);
  };
  // A start looks for the same corners in each frame.
  is_starved_ = !last_has_pose_ && filter_.HasBoxes() && (is_starved_ || are_few());
  deferred_.clear();
  if (is_starved_) {
    for (const Box& box : filter_.Boxes()) {
      deferred_.emplace_back(cvFloor(box.x), cvFloor(box.y), cvCeil(box.width), cvCeil(box.height));
    }
  }
  extractor_.Defer(deferred_);
  const int usual = orb_options_.fast_threshold_min;
  extractor_.SetMinThreshold(is_starved_ ? std::min(usual, orb_options_.fast_threshold_starved) : usual);
}

void Tracker::CorrectShutter() {
  if (shutter_.IsRolling()) shutter_.Correct(last_, MedianDepthOfFrame(), &frame_);
}

TrackingResult Tracker::Track(const FrameObjects& objects, int keyframes_waiting) {
  DS_TRACE("tracking");
  inliers_ = 0;
  reason_.clear();
  late_judgement_.Judge(objects.late, filter_, &initializer_, map_);
  untold_from_ = objects.untold_from;
  TrackingResult result;
  const size_t keypoints = frame_.features.size();
  shows_nothing_ = last_has_pose_ && ShowsNothing();
  if (!shows_nothing_) {
    result.dynamic = filter_.Judge(objects.boxes, flow_, last_, &frame_);
    share_in_boxes_ =
        keypoints == 0 ? 0 : static_cast<double>(result.dynamic.InBoxes()) / static_cast<double>(keypoints);
  } else {  // what is known of the objects stays that of the last frame
    frame_.static_probability.assign(keypoints, 1.0f);
    frame_.motion_log_odds.assign(keypoints, 0.0f);
    result.dynamic.outside = static_cast<int>(keypoints);
  }
  result.keypoints = static_cast<int>(keypoints);
  if (!last_has_pose_) filter_.WatchBeforePose(flow_, last_, &frame_);
  if (!shows_nothing_ && (last_has_pose_ ? TrackFrame() : Relocalise())) {
    unconfirmed_.Add(frame_.id, !last_has_pose_, objects);
    AcceptPose();
    if (!start_is_certain_ && !unconfirmed_.Any()) ReviewStart(&result);
    if (state_ == TrackingState::kTracking && !result.part_was_erased && !unconfirmed_.Any()) {
      InsertKeyframeIfDue(keyframes_waiting, &result);
    }
  } else if (state_ == TrackingState::kInitialising) {
    Initialise(&result);
  } else {
    state_ = TrackingState::kLost;
    if (!shows_nothing_) {
      velocity_.reset();
      result.withdrawn = unconfirmed_.Withdraw();
      if (result.withdrawn > 0)
        reason_ += fmt::format("; poses by looks alone, of {} frames, are withdrawn", result.withdrawn);
    }
    lost_frames_ = follows_nothing_ && !shows_nothing_ ? 1 : lost_frames_ + 1;
    StartAnewWhenLostForLong(&result);
  }
  RememberKeyframes(result.new_keyframes);
  last_has_pose_ = state_ == TrackingState::kTracking || shows_nothing_;
  if (start_is_young_ && state_ == TrackingState::kTracking) {
    const PartId part = PartOfFrame();
    start_is_young_ = part == start_part_ &&
                      (!start_is_certain_ || map_->Read()->KeyframesIn(part) <= options_.small_map_keyframes);
  }
  result.is_provisional = start_is_young_ || unconfirmed_.Any();
  result.min_inliers = Limits().found;
  result.state = state_;
  result.inliers = inliers_;
  result.reason = reason_;
  return result;
}

void Tracker::RememberKeyframes(const std::vector<KeyframeId>& keyframes) {
  if (keyframes.empty()) return;
  const auto map = map_->Read();
  for (const KeyframeId id : keyframes) late_judgement_.Remember(map->keyframes().At(id).frame_id(), id);
}

void Tracker::AcceptPose() {
  if (state_ == TrackingState::kInitialising) {  // a known place was found first
    initializer_.Reset();
    start_is_certain_ = true;
  }
  state_ = TrackingState::kTracking;
  if (!unconfirmed_.Any()) {
    lost_frames_ = 0;
    CountVisibility();
  }
  localiser_.Anchor(&frame_);
  velocity_.reset();
  if (last_has_pose_) {
    velocity_ = frame_.cam_from_world * last_.cam_from_world.Inverse();
    velocity_dt_s_ = frame_.timestamp_s - last_.timestamp_s;
    if (!flow_.motions().empty()) filter_.Watch(flow_, last_, MedianDepthOfFrame(), &frame_);
  }
  const bool is_asked = options_.seeds_min_share < 1 && !options_.localise_only;
  const bool are_due = is_asked && share_in_boxes_ >= options_.seeds_min_share;
  if (!last_has_pose_ || !are_due) seeds_.Clear();
  if (are_due) seeds_.Follow(velocity_.value_or(Rigid3()), MedianDepthOfFrame(), frame_);
}

void Tracker::SetLocaliseOnly(bool localise_only) {
  options_.localise_only = localise_only;
  if (!localise_only) return;
  start_is_certain_ = true;
  start_is_young_ = false;
  if (state_ == TrackingState::kInitialising) state_ = TrackingState::kLost;
  initializer_.Reset();
}

void Tracker::Initialise(TrackingResult* result) {
  const std::optional<InitialProposal> proposal = initializer_.Propose(frame_, random_, untold_from_);
  reason_ = initializer_.reason();
  if (proposal.has_value()) {
    StartMap(*proposal, result);
  } else if (filter_.HasBoxes() && filter_.OnlyBoxesMove(flow_.motions())) {
    reason_ += "; only what is in the boxes of dynamic objects moves";
  }
}

void Tracker::StartMap(const InitialProposal& proposal, TrackingResult* result) {
  {
    auto map = map_->Write();
    result->earlier_frames = initializer_.BuildMap(proposal, &frame_, map.get());
    result->map_epoch = map->epoch();
    const PartId part = start_part_ = map->keyframes().At(frame_.reference).part();
    result->new_keyframes.clear();
    map->keyframes().ForEach([&](const Keyframe& keyframe) {
      if (keyframe.part() == part) result->new_keyframes.push_back(keyframe.id());
    });
    inliers_ = map->keyframes().At(frame_.reference).LandmarkCount();
  }
  shutter_.Reset();
  start_is_young_ = true;
  start_is_certain_ = proposal.is_certain;
  if (start_is_certain_) initializer_.Reset();
  state_ = TrackingState::kTracking;
  start_frame_ = frame_.id;
  lost_frames_ = 0;
  velocity_.reset();
  last_keyframe_ = frame_.reference;
  last_keyframe_frame_ = frame_.id;
  most_inliers_ = 0;
  result->keyframe_reason = KeyframeReason::kStart;
}

void Tracker::ReviewStart(TrackingResult* result) {
  // Who was found in another part of the map, or whose part was recognised in another one, is certain.
  const bool is_in_start = PartOfFrame() == start_part_;
  if (is_in_start && frame_.id.value() - start_frame_.value() < kMaxReviews) {
    const FrameId reference = initializer_.reference();
    const std::optional<InitialProposal> proposal = initializer_.Propose(frame_, random_, untold_from_);
    if (initializer_.reference() != reference) {
      // The first view is out of sight, and nobody knows which motion it was.
      ErasePart(result);
      reason_ = initializer_.reason();
      return;
    }
    if (!proposal.has_value() || !proposal->is_certain) return;
    // The reference is the origin of the part.
    if (!Agree(frame_.cam_from_world, proposal->structure.last_from_reference)) {
      ErasePart(result);
      StartMap(*proposal, result);
      reason_ = "another motion fits better: " + initializer_.reason();
      return;
    }
  }
  start_is_certain_ = true;
  initializer_.Reset();
}

PartId Tracker::PartOfFrame() const { return map_->Read()->PartOf(frame_.reference); }

void Tracker::ErasePart(TrackingResult* result) {
  const PartId part = PartOfFrame();
  map_->Write()->ErasePart(part);
  ForgetPose();
  result->part_was_erased = true;
  result->new_keyframes.clear();
}

void Tracker::ForgetPose() {
  seeds_.Clear();
  visibility_.Clear();
  state_ = TrackingState::kInitialising;
  start_is_certain_ = true;
  start_is_young_ = false;
  unconfirmed_ = {};
  last_has_pose_ = shows_nothing_ = false;
  velocity_.reset();
  lost_frames_ = 0;
  inliers_ = 0;
}

void Tracker::Reset() {
  map_->Write()->Reset();
  ForgetPose();
  // Those of the map that is gone; and frames are counted anew.
  frame_.reference = last_.reference = last_keyframe_ = KeyframeId();
  last_keyframe_frame_ = FrameId();
  start_part_ = PartId();
  most_inliers_ = 0;
  initializer_.Reset();
  filter_.Reset();
  late_judgement_.Reset();
  shutter_.Reset();
  share_in_boxes_ = 0;
  is_starved_ = false;
  random_ = Random(seed_);
}

// Local mapping may have moved, merged or erased what the last frame saw, and added to it.
void Tracker::RefreshLastFrame() {
  const auto map = map_->Read();
  last_.cam_from_world = map->PoseFromReference(last_.reference, last_.cam_from_reference);
  const double unit = map->UnitOf(last_.reference);
  if (velocity_.has_value()) velocity_->translation *= unit / last_.reference_unit;
  seeds_.Scale(unit / last_.reference_unit);
  last_.reference_unit = unit;
  revision_ = map->revision();
  const Keyframe* keyframe = map->keyframes().Find(last_keyframe_);
  if (keyframe != nullptr && keyframe->frame_id() == last_.id) last_.landmarks = keyframe->landmarks();
  for (size_t i = 0; i < last_.landmarks.size(); ++i) {
    if (!last_.landmarks[i].IsValid()) continue;
    last_.landmarks[i] = map->Resolve(last_.landmarks[i]);
    if (!last_.landmarks[i].IsValid()) continue;
    const Landmark& landmark = map->landmarks().At(last_.landmarks[i]);
    last_.points[i] = landmark.position();
    last_.spreads[i] = landmark.spread();
    last_.static_log_odds[i] = landmark.static_log_odds;
  }
}

// Goes on as the camera went between the last two frames.
std::optional<Rigid3> Tracker::PredictMotion(double dt_s) const {
  if (!velocity_.has_value()) return std::nullopt;
  const double steps = velocity_dt_s_ > 0 ? std::clamp(dt_s / velocity_dt_s_, 0.0, kMaxPredictionSteps) : 1;
  return Rigid3(ExpSo3(steps * LogSo3(velocity_->rotation)), steps * velocity_->translation);
}

std::optional<Eigen::Quaterniond> Tracker::PredictedRotation() const {
  const std::optional<Rigid3> motion = PredictMotion(image_interval_s_);
  return motion.has_value() ? std::optional(motion->rotation) : std::nullopt;
}

std::optional<Eigen::Quaterniond> Tracker::Rotation() const {
  const bool is_since_last_image = !shows_nothing_ && !follows_nothing_;
  return velocity_.has_value() && is_since_last_image ? std::optional(velocity_->rotation) : std::nullopt;
}

// No light, a hand before the lens: the next frame goes on from the last one.
bool Tracker::ShowsNothing() {
  const auto needed = static_cast<size_t>(options_.min_motion_inliers);
  if (frame_.features.size() >= needed) return false;
  reason_ = fmt::format("lost: the image shows nothing, {} keypoints < {}", frame_.features.size(), needed);
  return true;
}

bool Tracker::TrackFrame() {
  RefreshLastFrame();
  const uint32_t revision = revision_;
  const bool tracked = TrackFromLastFrame();
  if (revision_ == revision) return tracked;
  // Points from before a correction of the map were mixed with points from after it.
  RefreshLastFrame();
  return TrackFromLastFrame();
}

bool Tracker::TrackFromLastFrame() {
  const Rigid3 predicted =
      PredictMotion(frame_.timestamp_s - last_.timestamp_s).value_or(Rigid3()) * last_.cam_from_world;
  int inliers =
      localiser_.pose_tracker().TrackFromFrame(last_, predicted, options_.motion_radius_px, &frame_);
  if (inliers < options_.min_motion_inliers) {
    inliers = localiser_.pose_tracker().TrackFromFrame(last_, last_.cam_from_world,
                                                       kWideSearch * options_.motion_radius_px, &frame_);
  }
  if (inliers < options_.min_motion_inliers) {
    reason_ =
        fmt::format("lost: {} landmarks of the last frame found < {}", inliers, options_.min_motion_inliers);
    return false;
  }
  CorrectShutter();
  return TrackLocalMap();
}

InlierLimits Tracker::Limits() const {
  const size_t keypoints = std::min(frame_.features.size(), static_cast<size_t>(orb_options_.features));
  return NeededInliers(options_, keypoints, share_in_boxes_);
}

bool Tracker::TrackLocalMap() {
  DS_TRACE("tracking/local map");
  localiser_.LookAround(frame_);
  revision_ = localiser_.view().revision;
  localiser_.MatchView(options_.local_map_radius_px, &frame_);
  // The local map knows the pose better than the last frame's landmarks did, and with it the motion.
  CorrectShutter();
  inliers_ = localiser_.MatchView(options_.local_map_radius_px, &frame_);
  const InlierLimits limits = Limits();
  if (inliers_ < limits.found) {
    reason_ = fmt::format("lost: {} landmarks of the local map found < {}", inliers_, limits.found);
    return false;
  }
  // Among chance matches, as in a blurred image, some pose always fits.
  const double right = localiser_.pose_tracker().RightInliers();
  if (right >= limits.right) return true;
  reason_ = fmt::format("lost: of {} landmarks of the local map found {:.0f} can be right < {}", inliers_,
                        std::floor(right), limits.right);
  return false;
}

bool Tracker::Relocalise() {
  const std::optional<MapLocaliser::Place> place = localiser_.Relocalise(Limits().found, random_, &frame_);
  if (place.has_value()) {
    inliers_ = place->inliers;
    reason_ = fmt::format("found again by keyframe {}", place->keyframe.value());
    return true;
  }
  inliers_ = 0;
  if (localiser_.candidates() == 0) return false;
  reason_ = fmt::format("lost for {} frames; none of {} keyframes matches the image", lost_frames_ + 1,
                        localiser_.candidates());
  return false;
}

// Of the landmarks that the frame shows.
double Tracker::MedianDepthOfFrame() {
  depths_.clear();
  for (size_t i = 0; i < frame_.landmarks.size(); ++i) {
    if (frame_.landmarks[i].IsValid()) depths_.push_back((frame_.cam_from_world * frame_.points[i]).z());
  }
  return depths_.empty() ? 0 : Median(&depths_);
}

void Tracker::CountVisibility() {
  const bool shield = filter_.options().shield_hidden && filter_.HasBoxes();
  const LocalView& view = localiser_.view();
  for (size_t k = 0; k < view.size(); ++k) {
    if (localiser_.in_view()[k] == 0) continue;
    const uint32_t i = view.near[k];
    // Nobody sees what is behind a person; where it is found after all, that counts as seen too.
    if (shield && filter_.IsHidden(camera_.Project(frame_.cam_from_world * view.positions[i]))) {
      continue;
    }
    visibility_.visible.push_back(view.ids[i]);
  }
  for (size_t i = 0; i < frame_.landmarks.size(); ++i) {
    if (!frame_.landmarks[i].IsValid()) continue;
    visibility_.found.push_back(frame_.landmarks[i]);
    visibility_.Judge(frame_.landmarks[i], filter_.Evidence(frame_.static_probability[i], true));
  }
  for (const LandmarkId id : localiser_.pose_tracker().rejected())
    visibility_.Judge(id, filter_.Evidence(0.5f, false));
}

void Tracker::InsertKeyframeIfDue(int keyframes_waiting, TrackingResult* result) {
  if (options_.localise_only) {
    visibility_.Clear();
    return;
  }
  most_inliers_ = std::max(most_inliers_, inliers_);
  KeyframePolicyInput input;
  input.frames_since_keyframe = static_cast<int>(frame_.id.value() - last_keyframe_frame_.value());
  input.inliers = inliers_;
  input.most_inliers = most_inliers_;
  input.keyframes_waiting = keyframes_waiting;
  result->keyframe_reason = DecideKeyframe(input, options_.keyframe);
  if (result->keyframe_reason == KeyframeReason::kNone) return;
  {
    auto map = map_->Write();
    visibility_.ApplyTo(map.get());
    // What the frame's pose is relative to may have moved since the view was made.
    const Map::Anchor anchor = map->ResolveKeyframe(frame_.reference);
    if (anchor.keyframe != frame_.reference ||
        map->keyframes().At(anchor.keyframe).cam_from_world() != localiser_.view().reference_from_world) {
      frame_.cam_from_world = map->PoseFromReference(frame_.reference, frame_.cam_from_reference);
    }
    last_keyframe_ = InsertKeyframe(frame_, map.get(), map->keyframes().At(anchor.keyframe).part());
    seeds_.Plant(last_keyframe_, map.get());
    result->map_epoch = map->epoch();
  }
  last_keyframe_frame_ = frame_.id;
  most_inliers_ = 0;
  frame_.reference = last_keyframe_;
  frame_.cam_from_reference = Rigid3();
  frame_.reference_unit = 1;
  result->new_keyframes.push_back(last_keyframe_);
}

// A map that lost the camera so soon was probably wrong from the start; another one is kept, and becomes one
// with the new one when a place in it is known again.
void Tracker::StartAnewWhenLostForLong(TrackingResult* result) {
  const int patience = shows_nothing_ ? kMostDarkFrames : options_.restart_after_frames;
  if (lost_frames_ < patience || options_.localise_only) return;
  const PartId part = PartOfFrame();
  const int keyframes =
      part.IsValid() ? map_->Read()->KeyframesIn(part) : static_cast<int>(map_->Read()->keyframes().size());
  // Only what was started here may be wrong.
  const bool is_small = part.IsValid() && part == start_part_ && keyframes <= options_.small_map_keyframes;
  reason_ = fmt::format("starting again: lost for {} frames; the map of {} keyframes is {}", lost_frames_,
                        keyframes, is_small ? "given up" : "kept");
  is_small ? ErasePart(result) : ForgetPose();
  initializer_.Reset();
}

}  // namespace dynamic_slam
