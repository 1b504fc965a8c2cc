#include "dynamic_slam/tracking/backfiller.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/geometry/path_leaps.h"
#include "dynamic_slam/tracking/keyframe_policy.h"

namespace dynamic_slam {
namespace {

constexpr size_t kMaxKeypoints = 2'000'000;

// So many frames in a row are bridged from the poses beside them.
constexpr int kMostBridged = 4;

}  // namespace

Backfiller::Backfiller(const Camera& camera, const TrackerOptions& options, uint64_t seed, SharedMap* map)
    : options_(options), map_(map), finder_(camera, options, map), seed_(seed) {}

void Backfiller::Keep(const Frame& frame, int min_inliers, bool has_pose) {
  auto next = kept_.end();
  while (next != kept_.begin() && std::prev(next)->timestamp_s > frame.timestamp_s) --next;
  if (next != kept_.begin() && std::prev(next)->timestamp_s == frame.timestamp_s) return;
  const auto kept = kept_.insert(
      next,
      {frame.id, frame.timestamp_s, frame.features, frame.static_probability, min_inliers, has_pose, {}});
  kept->features.keypoints = FrameFinder::ReadKeypoints(frame);
  keypoints_ += frame.features.size();
  while (keypoints_ > kMaxKeypoints) {
    keypoints_ -= kept_.front().features.size();
    kept_.pop_front();
  }
}

template <class Predicate>
void Backfiller::Forget(Predicate&& is_forgotten) {
  std::erase_if(kept_, [&](const KeptFrame& kept) {
    const bool is_it = is_forgotten(kept);
    if (is_it) keypoints_ -= kept.features.size();
    return is_it;
  });
}

void Backfiller::ForgetPosed() {
  Forget([](const KeptFrame& kept) { return kept.has_pose; });
}

void Backfiller::PartWasErased() {
  for (KeptFrame& kept : kept_) kept.has_pose = false;
}

void Backfiller::LastWereWithdrawn(int count) {
  for (auto kept = kept_.rbegin(); kept != kept_.rend() && count > 0; ++kept)
    count -= std::exchange(kept->has_pose, false);
}

void Backfiller::Clear() {
  kept_.clear();
  keypoints_ = 0;
  map_keyframe_ = nullptr;
}

std::vector<AnchoredPose> Backfiller::Find(std::span<const AnchoredPose> known,
                                           const std::function<bool()>& should_stop) {
  DS_TRACE("backfill");
  KnownPoses poses(known, map_);
  for (KeptFrame& kept : kept_) kept.tried_between.reset();  // in another map
  std::vector<AnchoredPose> found;
  if (Spread(should_stop, &poses, &found) && Recognise(should_stop, &poses, &found))
    Spread(should_stop, &poses, &found);
  return found;
}

bool Backfiller::PlanGrowth(std::span<const AnchoredPose> known, const std::function<bool()>& should_stop) {
  return LeaveOut(known, Find(known, should_stop));
}

std::vector<AnchoredPose> Backfiller::Grow(std::span<const AnchoredPose> known,
                                           const MapKeyframe& map_keyframe,
                                           const std::function<bool()>& should_stop) {
  map_keyframe_ = map_keyframe;
  chain_ = {};
  std::vector<AnchoredPose> found = Find(known, should_stop);
  map_keyframe_ = nullptr;
  return found;
}

std::set<double> Backfiller::Stamps() const {
  std::set<double> stamps;
  for (const KeptFrame& kept : kept_) stamps.insert(kept.timestamp_s);
  return stamps;
}

void Backfiller::KeepOnly(const std::set<double>& stamps) {
  Forget([&stamps](const KeptFrame& kept) { return !stamps.contains(kept.timestamp_s); });
}

bool Backfiller::LeaveOut(std::span<const AnchoredPose> known, const std::vector<AnchoredPose>& found) {
  std::set<double> stamps;
  for (const AnchoredPose& pose : known) stamps.insert(pose.timestamp_s);
  for (const AnchoredPose& pose : found) stamps.insert(pose.timestamp_s);
  bool is_any_left = false;
  for (size_t first = 0, last = 0; first < kept_.size(); first = last) {
    int missing = 0, most_missing = 0;
    for (last = first; last < kept_.size(); ++last) {
      if (last > first && kept_[last].id.value() != kept_[last - 1].id.value() + 1) break;
      missing = stamps.contains(kept_[last].timestamp_s) ? 0 : missing + 1;
      most_missing = std::max(most_missing, missing);
    }
    for (size_t i = first; i < last; ++i) kept_[i].is_left_out = most_missing <= kMostBridged;
    is_any_left |= most_missing > kMostBridged;
  }
  return is_any_left;
}

bool Backfiller::Spread(const std::function<bool()>& should_stop, KnownPoses* known,
                        std::vector<AnchoredPose>* found) {
  // To and fro, as each pose found is a neighbour to the next.
  for (bool is_forward = true, goes_on = true; goes_on || !is_forward; is_forward = !is_forward) {
    if (is_forward) goes_on = false;
    for (size_t i = 0; i < kept_.size(); ++i) {
      KeptFrame& kept = kept_[is_forward ? i : kept_.size() - 1 - i];
      if (IsLeftOut(kept) || known->Contains(kept.timestamp_s)) continue;
      if (should_stop && should_stop()) return false;
      const std::optional<AnchoredPose> pose = FindFromNeighbours(*known, &kept);
      if (!pose.has_value()) continue;
      known->Add(*pose);
      found->push_back(*pose);
      goes_on = true;
    }
  }
  return true;
}

bool Backfiller::Recognise(const std::function<bool()>& should_stop, KnownPoses* known,
                           std::vector<AnchoredPose>* found) {
  if (!(known->interval_s() > 0)) return true;  // nobody knows which frames are in a row
  Random random(seed_);
  KnownPoses with_recognised = *known;
  bool goes_on = true;
  for (const KeptFrame& kept : kept_) {
    if (IsLeftOut(kept) || known->Contains(kept.timestamp_s)) continue;
    goes_on = !should_stop || !should_stop();
    if (!goes_on) break;
    Frame frame = FrameOf(kept);
    if (!finder_.localiser().Relocalise(kept.min_inliers, random, &frame).has_value()) continue;
    const std::optional<AnchoredPose> pose = finder_.PlausiblePose(*known, &frame);
    if (pose.has_value()) with_recognised.Add(*pose);
  }
  const KnownPoses::ByStamp& all = with_recognised.by_stamp();
  for (auto pose = all.begin(); pose != all.end(); ++pose) {
    if (known->Contains(pose->first)) continue;
    const auto agrees = [&](const AnchoredPose& other) {
      return std::abs(other.timestamp_s - pose->first) <= kNextFrame * known->interval_s() &&
             known->AreInOnePart(other, pose->second) && known->IsReachable(other, pose->second);
    };
    const bool is_confirmed = (pose != all.begin() && agrees(std::prev(pose)->second)) ||
                              (std::next(pose) != all.end() && agrees(std::next(pose)->second));
    // Others that were recognised before it are known by now.
    if (!is_confirmed || !known->IsPlausible(pose->second)) continue;
    known->Add(pose->second);
    found->push_back(pose->second);
  }
  return goes_on;
}

Frame Backfiller::FrameOf(const KeptFrame& kept) {
  return finder_.MakeFrame(kept.id, kept.timestamp_s, kept.features, kept.static_probability);
}

std::optional<AnchoredPose> Backfiller::FindFromNeighbours(const KnownPoses& known, KeptFrame* kept) {
  const std::pair<double, double> between = known.Between(kept->timestamp_s);
  if (kept->tried_between == between) return std::nullopt;
  kept->tried_between = between;

  const std::vector<KnownPoses::Guess> guesses = known.Guesses(kept->timestamp_s);
  if (guesses.empty()) return std::nullopt;
  Frame frame = FrameOf(*kept);
  for (const KnownPoses::Guess& guess : guesses) {
    for (const double search : KnownPoses::kSearches) {
      const int inliers = finder_.Find(known, guess, search, kept->min_inliers, &frame);
      if (inliers == 0) continue;
      std::optional<AnchoredPose> pose = finder_.PlausiblePose(known, &frame);
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

}  // namespace dynamic_slam
