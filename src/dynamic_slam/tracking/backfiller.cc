#include "dynamic_slam/tracking/backfiller.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <set>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/tracking/keyframe_policy.h"

namespace dynamic_slam {
namespace {

constexpr size_t kMaxKeypoints = 2'000'000;

// From poses more frames away nobody knows where the camera is.
constexpr double kMaxGapFrames = 4;

// Frames in a row are no farther apart, in intervals.
constexpr double kNextFrame = 1.5;

// A camera that is so many times as fast as it nearly always was between two frames is a wrong pose: a few
// landmarks found by chance, or on somebody who moves. With fewer steps known nobody can tell.
constexpr double kMaxSpeedRatio = 2, kNearlyAlways = 0.95;
constexpr size_t kMinSteps = 20;

// A motion is not carried on for longer than so many times the time in which it was seen.
constexpr double kMaxSteps = 5;

// What the motion model looks through, and, as it is only a guess, three times as much.
constexpr double kSearches[] = {1.0, 3.0};

double Percentile(double share, std::vector<double>* values) {
  const auto at =
      values->begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values->size() - 1));
  std::nth_element(values->begin(), at, values->end());
  return *at;
}

Eigen::Vector3d CentreOf(const AnchoredPose& pose, const Map& map) {
  return map.PoseFromReference(pose.reference, pose.cam_from_reference).TargetOriginInSource();
}

}  // namespace

Backfiller::Backfiller(const Camera& camera, const TrackerOptions& options, uint64_t seed, SharedMap* map)
    : options_(options),
      map_(map),
      shutter_(camera),
      localiser_(camera, options, map->Read()->octave_scales(), map),
      seed_(seed) {}

void Backfiller::Keep(const Frame& frame, int min_inliers, bool has_pose) {
  kept_.push_back(
      {frame.id, frame.timestamp_s, frame.features, frame.static_probability, min_inliers, has_pose, {}});
  // As they were read: the motion that was expected then is not that of the pose.
  std::vector<Keypoint>& keypoints = kept_.back().features.keypoints;
  for (size_t i = 0; i < frame.read_px.size(); ++i)
    keypoints[i].x = frame.read_px[i].x(), keypoints[i].y = frame.read_px[i].y();
  keypoints_ += frame.features.size();
  while (keypoints_ > kMaxKeypoints) {
    keypoints_ -= kept_.front().features.size();
    kept_.pop_front();
  }
}

void Backfiller::ForgetPosed() {
  std::erase_if(kept_, [this](const KeptFrame& kept) {
    if (kept.has_pose) keypoints_ -= kept.features.size();
    return kept.has_pose;
  });
}

void Backfiller::PartWasErased() {
  for (KeptFrame& kept : kept_) kept.has_pose = false;
}

void Backfiller::Clear() {
  kept_.clear();
  keypoints_ = 0;
  map_keyframe_ = nullptr;
}

std::vector<AnchoredPose> Backfiller::Find(std::span<const AnchoredPose> known,
                                           const std::function<bool()>& should_stop) {
  DS_TRACE("backfill");
  Known poses;
  for (const AnchoredPose& pose : known) poses.emplace(pose.timestamp_s, pose);
  LearnMotion(poses);
  for (KeptFrame& kept : kept_) kept.tried_between.reset();  // in another map
  std::vector<AnchoredPose> found;
  if (Spread(should_stop, &poses, &found) && Recognise(should_stop, &poses, &found))
    Spread(should_stop, &poses, &found);
  return found;
}

std::vector<AnchoredPose> Backfiller::Grow(std::span<const AnchoredPose> known,
                                           const MapKeyframe& map_keyframe,
                                           const std::function<bool()>& should_stop) {
  LeaveOut(known, Find(known, should_stop));
  map_keyframe_ = map_keyframe;
  chain_ = {};
  std::vector<AnchoredPose> found = Find(known, should_stop);
  map_keyframe_ = nullptr;
  for (KeptFrame& kept : kept_) kept.is_left_out = false;
  return found;
}

void Backfiller::LeaveOut(std::span<const AnchoredPose> known, const std::vector<AnchoredPose>& found) {
  std::set<double> stamps;
  for (const AnchoredPose& pose : known) stamps.insert(pose.timestamp_s);
  for (const AnchoredPose& pose : found) stamps.insert(pose.timestamp_s);
  for (size_t first = 0, last = 0; first < kept_.size(); first = last) {
    int missing = 0, most_missing = 0;
    for (last = first; last < kept_.size(); ++last) {
      if (last > first && kept_[last].id.value() != kept_[last - 1].id.value() + 1) break;
      missing = stamps.contains(kept_[last].timestamp_s) ? 0 : missing + 1;
      most_missing = std::max(most_missing, missing);
    }
    for (size_t i = first; i < last; ++i) kept_[i].is_left_out = most_missing <= kMaxGapFrames;
  }
}

bool Backfiller::Spread(const std::function<bool()>& should_stop, Known* known,
                        std::vector<AnchoredPose>* found) {
  // To and fro, as each pose found is a neighbour to the next.
  for (bool is_forward = true, goes_on = true; goes_on || !is_forward; is_forward = !is_forward) {
    if (is_forward) goes_on = false;
    for (size_t i = 0; i < kept_.size(); ++i) {
      KeptFrame& kept = kept_[is_forward ? i : kept_.size() - 1 - i];
      if (kept.is_left_out || known->contains(kept.timestamp_s)) continue;
      if (should_stop && should_stop()) return false;
      const std::optional<AnchoredPose> pose = FindFromNeighbours(*known, &kept);
      if (!pose.has_value()) continue;
      known->emplace(pose->timestamp_s, *pose);
      found->push_back(*pose);
      goes_on = true;
    }
  }
  return true;
}

bool Backfiller::Recognise(const std::function<bool()>& should_stop, Known* known,
                           std::vector<AnchoredPose>* found) {
  if (!(interval_s_ > 0)) return true;  // nobody knows which frames are in a row
  Random random(seed_);
  Known with_recognised = *known;
  bool goes_on = true;
  for (const KeptFrame& kept : kept_) {
    if (kept.is_left_out || known->contains(kept.timestamp_s)) continue;
    goes_on = !should_stop || !should_stop();
    if (!goes_on) break;
    Frame frame = FrameOf(kept);
    if (!localiser_.Relocalise(kept.min_inliers, random, &frame).has_value()) continue;
    const std::optional<AnchoredPose> pose = PlausiblePose(*known, &frame);
    if (pose.has_value()) with_recognised.emplace(pose->timestamp_s, *pose);
  }
  for (auto pose = with_recognised.begin(); pose != with_recognised.end(); ++pose) {
    if (known->contains(pose->first)) continue;
    const auto agrees = [&](const AnchoredPose& other) {
      return std::abs(other.timestamp_s - pose->first) <= kNextFrame * interval_s_ &&
             AreInOnePart(other, pose->second) && IsReachable(other, pose->second);
    };
    const bool is_confirmed = (pose != with_recognised.begin() && agrees(std::prev(pose)->second)) ||
                              (std::next(pose) != with_recognised.end() && agrees(std::next(pose)->second));
    // Others that were recognised before it are known by now.
    if (!is_confirmed || !IsPlausible(*known, pose->second)) continue;
    known->insert(*pose);
    found->push_back(pose->second);
  }
  return goes_on;
}

void Backfiller::CorrectShutterAt(const Known& known, const Guess& guess, Frame* frame) const {
  if (!shutter_.IsRolling()) return;
  const auto next = known.upper_bound(frame->timestamp_s);
  const AnchoredPose* nearest = next == known.end() ? nullptr : &next->second;
  if (next != known.begin()) {
    const AnchoredPose& before = std::prev(next)->second;
    if (nearest == nullptr ||
        frame->timestamp_s - before.timestamp_s < nearest->timestamp_s - frame->timestamp_s)
      nearest = &before;
  }
  if (nearest == nullptr || std::abs(frame->timestamp_s - nearest->timestamp_s) > max_gap_s_) return;
  const auto map = map_->Read();
  if (map->PartOf(nearest->reference) != map->PartOf(guess.keyframe)) return;
  const Rigid3 other = map->PoseFromReference(nearest->reference, nearest->cam_from_reference);
  const SteadyMotion motion =
      MotionBetween(guess.cam_from_world * other.Inverse(), frame->timestamp_s - nearest->timestamp_s);
  const double depth = map->MedianDepth(guess.keyframe);
  shutter_.Move(motion, depth > 0 ? 1 / depth : 0, frame);
}

Frame Backfiller::FrameOf(const KeptFrame& kept) {
  Frame frame;
  frame.id = kept.id;
  frame.timestamp_s = kept.timestamp_s;
  frame.features = kept.features;
  frame.static_probability = kept.static_probability;
  frame.ClearLandmarks();
  shutter_.Begin(&frame);
  return frame;
}

std::optional<AnchoredPose> Backfiller::PlausiblePose(const Known& known, Frame* frame) {
  localiser_.Anchor(frame);
  const AnchoredPose pose{frame->timestamp_s, frame->reference, frame->cam_from_reference};
  return IsPlausible(known, pose) ? std::optional(pose) : std::nullopt;
}

std::optional<AnchoredPose> Backfiller::FindFromNeighbours(const Known& known, KeptFrame* kept) {
  const auto next = known.upper_bound(kept->timestamp_s);
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const std::pair between(next == known.begin() ? -kNone : std::prev(next)->first,
                          next == known.end() ? kNone : next->first);
  if (kept->tried_between == between) return std::nullopt;
  kept->tried_between = between;

  const std::vector<Guess> guesses = Guesses(known, kept->timestamp_s);
  if (guesses.empty()) return std::nullopt;
  Frame frame = FrameOf(*kept);
  for (const Guess& guess : guesses) {
    for (const double search : kSearches) {
      CorrectShutterAt(known, guess, &frame);
      if (localiser_.TrackNear(guess.keyframe, guess.cam_from_world, search * options_.motion_radius_px,
                               &frame) < options_.min_motion_inliers)
        continue;
      CorrectShutterAt(known, {guess.keyframe, frame.cam_from_world}, &frame);
      const int inliers = localiser_.TrackLocalMap(options_.local_map_radius_px, &frame);
      if (localiser_.pose_tracker().RightInliers() < kept->min_inliers) continue;
      std::optional<AnchoredPose> pose = PlausiblePose(known, &frame);
      if (!pose.has_value()) continue;
      if (map_keyframe_) GrowBy(frame, inliers, &*pose);
      return pose;
    }
  }
  return std::nullopt;
}

void Backfiller::GrowBy(const Frame& frame, int inliers, AnchoredPose* pose) {
  const int64_t number = frame.id.value();
  const bool goes_on = std::abs(number - chain_.last) == 1;
  chain_.last = number;
  chain_.most_inliers = std::max(chain_.most_inliers, inliers);
  KeyframePolicyInput input;
  input.frames_since_keyframe = static_cast<int>(std::abs(number - chain_.keyframe));
  input.inliers = inliers;
  input.most_inliers = chain_.most_inliers;
  // The first one stands where tracking was lost for want of landmarks.
  if (goes_on && DecideKeyframe(input, options_.keyframe) == KeyframeReason::kNone) return;
  {
    const auto map = map_->Write();
    pose->reference = InsertKeyframe(frame, map.get(), map->PartOf(pose->reference));
  }
  pose->cam_from_reference = Rigid3();
  chain_ = {number, number, inliers};
  map_keyframe_(pose->reference);
}

std::vector<Backfiller::Guess> Backfiller::Guesses(const Known& known, double timestamp_s) const {
  std::vector<Guess> guesses;
  const auto next = known.upper_bound(timestamp_s);
  const AnchoredPose *before = nullptr, *after = nullptr, *before_that = nullptr, *after_that = nullptr;
  if (next != known.begin() && timestamp_s - std::prev(next)->first <= max_gap_s_) {
    before = &std::prev(next)->second;
    if (std::prev(next) != known.begin()) before_that = &std::prev(next, 2)->second;
  }
  if (next != known.end() && next->first - timestamp_s <= max_gap_s_) {
    after = &next->second;
    if (std::next(next) != known.end()) after_that = &std::next(next)->second;
  }
  const auto map = map_->Read();
  if (before != nullptr && after != nullptr &&
      map->PartOf(before->reference) == map->PartOf(after->reference)) {
    const double share = (timestamp_s - before->timestamp_s) / (after->timestamp_s - before->timestamp_s);
    const Rigid3 from = map->PoseFromReference(before->reference, before->cam_from_reference).Inverse();
    const Rigid3 to = map->PoseFromReference(after->reference, after->cam_from_reference).Inverse();
    const Rigid3 world_from_cam(from.rotation.slerp(share, to.rotation),
                                (1 - share) * from.translation + share * to.translation);
    const AnchoredPose& nearer = share < 0.5 ? *before : *after;
    guesses.push_back({map->ResolveKeyframe(nearer.reference).keyframe, world_from_cam.Inverse()});
  }
  if (before != nullptr) Extrapolate(*before, before_that, timestamp_s, *map, &guesses);
  if (after != nullptr) Extrapolate(*after, after_that, timestamp_s, *map, &guesses);
  return guesses;
}

void Backfiller::Extrapolate(const AnchoredPose& nearer, const AnchoredPose* farther, double timestamp_s,
                             const Map& map, std::vector<Guess>* guesses) const {
  const KeyframeId keyframe = map.ResolveKeyframe(nearer.reference).keyframe;
  const Rigid3 pose = map.PoseFromReference(nearer.reference, nearer.cam_from_reference);
  if (farther != nullptr && map.PartOf(farther->reference) == map.PartOf(nearer.reference)) {
    const Rigid3 motion =
        pose * map.PoseFromReference(farther->reference, farther->cam_from_reference).Inverse();
    const double steps =
        std::min((timestamp_s - nearer.timestamp_s) / (nearer.timestamp_s - farther->timestamp_s), kMaxSteps);
    guesses->push_back(
        {keyframe, Rigid3(ExpSo3(steps * LogSo3(motion.rotation)), steps * motion.translation) * pose});
  }
  guesses->push_back({keyframe, pose});
}

void Backfiller::LearnMotion(const Known& known) {
  interval_s_ = max_gap_s_ = 0;
  max_speed_.clear();
  std::vector<double> intervals_s;
  for (auto pose = known.begin(); pose != known.end() && std::next(pose) != known.end(); ++pose) {
    intervals_s.push_back(std::next(pose)->first - pose->first);
  }
  if (intervals_s.empty()) return;
  interval_s_ = Percentile(0.5, &intervals_s);
  max_gap_s_ = kMaxGapFrames * interval_s_;
  std::map<PartId, std::vector<double>> speeds;
  const auto map = map_->Read();
  for (auto pose = known.begin(); std::next(pose) != known.end(); ++pose) {
    const AnchoredPose &a = pose->second, &b = std::next(pose)->second;
    const double dt_s = b.timestamp_s - a.timestamp_s;
    const PartId part = map->PartOf(a.reference);
    if (dt_s > max_gap_s_ || map->PartOf(b.reference) != part) continue;
    speeds[part].push_back((CentreOf(a, *map) - CentreOf(b, *map)).norm() / dt_s);
  }
  for (auto& [part, all] : speeds) {
    if (all.size() >= kMinSteps) max_speed_[part] = kMaxSpeedRatio * Percentile(kNearlyAlways, &all);
  }
}

bool Backfiller::AreInOnePart(const AnchoredPose& a, const AnchoredPose& b) const {
  const auto map = map_->Read();
  return map->PartOf(a.reference) == map->PartOf(b.reference);
}

bool Backfiller::IsReachable(const AnchoredPose& a, const AnchoredPose& b) const {
  const auto map = map_->Read();
  const PartId part = map->PartOf(a.reference);
  const auto limit = max_speed_.find(part);
  return limit == max_speed_.end() || map->PartOf(b.reference) != part ||
         (CentreOf(a, *map) - CentreOf(b, *map)).norm() <=
             limit->second * std::abs(a.timestamp_s - b.timestamp_s);
}

bool Backfiller::IsPlausible(const Known& known, const AnchoredPose& pose) const {
  const auto next = known.upper_bound(pose.timestamp_s);
  return (next == known.end() || IsReachable(next->second, pose)) &&
         (next == known.begin() || IsReachable(std::prev(next)->second, pose));
}

}  // namespace dynamic_slam
