#include "dynamic_slam/tracking/known_poses.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>

#include "dynamic_slam/base/percentile.h"
#include "dynamic_slam/geometry/path_leaps.h"

namespace dynamic_slam {
namespace {

// A motion is not carried on for longer than so many times the time in which it was seen.
constexpr double kMaxSteps = 5;

Eigen::Vector3d CentreOf(const AnchoredPose& pose, const Map& map) {
  return map.PoseFromReference(pose.reference, pose.cam_from_reference).TargetOriginInSource();
}

}  // namespace

KnownPoses::KnownPoses(std::span<const AnchoredPose> poses, const SharedMap* map) : map_(map) {
  for (const AnchoredPose& pose : poses) Add(pose);
  LearnMotion();
}

KnownPoses KnownPoses::Within(PartId part, double first_s, double last_s) const {
  KnownPoses those = *this;
  const auto map = map_->Read();
  std::erase_if(those.by_stamp_, [&](const auto& pose) {
    return pose.first < first_s || pose.first > last_s || map->PartOf(pose.second.reference) != part;
  });
  return those;
}

void KnownPoses::LearnMotion() {
  std::vector<double> intervals_s;
  for (auto pose = by_stamp_.begin(); pose != by_stamp_.end() && std::next(pose) != by_stamp_.end(); ++pose) {
    intervals_s.push_back(std::next(pose)->first - pose->first);
  }
  if (intervals_s.empty()) return;
  interval_s_ = Percentile(0.5, &intervals_s);
  max_gap_s_ = kMaxGapFrames * interval_s_;
  std::map<PartId, std::vector<double>> speeds;
  const auto map = map_->Read();
  for (auto pose = by_stamp_.begin(); std::next(pose) != by_stamp_.end(); ++pose) {
    const AnchoredPose &a = pose->second, &b = std::next(pose)->second;
    const double dt_s = b.timestamp_s - a.timestamp_s;
    const PartId part = map->PartOf(a.reference);
    if (dt_s > max_gap_s_ || map->PartOf(b.reference) != part) continue;
    speeds[part].push_back((CentreOf(a, *map) - CentreOf(b, *map)).norm() / dt_s);
  }
  for (auto& [part, all] : speeds) {
    if (const std::optional<double> most = MostSpeed(&all)) max_speed_[part] = *most;
  }
}

std::pair<double, double> KnownPoses::Between(double timestamp_s) const {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const auto next = by_stamp_.upper_bound(timestamp_s);
  return {next == by_stamp_.begin() ? -kNone : std::prev(next)->first,
          next == by_stamp_.end() ? kNone : next->first};
}

const AnchoredPose* KnownPoses::Nearest(double timestamp_s) const {
  const auto next = by_stamp_.upper_bound(timestamp_s);
  const AnchoredPose* nearest = next == by_stamp_.end() ? nullptr : &next->second;
  if (next != by_stamp_.begin()) {
    const AnchoredPose& before = std::prev(next)->second;
    if (nearest == nullptr || timestamp_s - before.timestamp_s < nearest->timestamp_s - timestamp_s)
      nearest = &before;
  }
  const bool is_near = nearest != nullptr && std::abs(timestamp_s - nearest->timestamp_s) <= max_gap_s_;
  return is_near ? nearest : nullptr;
}

std::vector<KnownPoses::Guess> KnownPoses::Guesses(double timestamp_s) const {
  std::vector<Guess> guesses;
  const auto next = by_stamp_.upper_bound(timestamp_s);
  const AnchoredPose *before = nullptr, *after = nullptr, *before_that = nullptr, *after_that = nullptr;
  if (next != by_stamp_.begin() && timestamp_s - std::prev(next)->first <= max_gap_s_) {
    before = &std::prev(next)->second;
    if (std::prev(next) != by_stamp_.begin()) before_that = &std::prev(next, 2)->second;
  }
  if (next != by_stamp_.end() && next->first - timestamp_s <= max_gap_s_) {
    after = &next->second;
    if (std::next(next) != by_stamp_.end()) after_that = &std::next(next)->second;
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

void KnownPoses::Extrapolate(const AnchoredPose& nearer, const AnchoredPose* farther, double timestamp_s,
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

bool KnownPoses::AreInOnePart(const AnchoredPose& a, const AnchoredPose& b) const {
  const auto map = map_->Read();
  return map->PartOf(a.reference) == map->PartOf(b.reference);
}

bool KnownPoses::IsReachable(const AnchoredPose& a, const AnchoredPose& b) const {
  const auto map = map_->Read();
  const PartId part = map->PartOf(a.reference);
  const auto limit = max_speed_.find(part);
  return limit == max_speed_.end() || map->PartOf(b.reference) != part ||
         (CentreOf(a, *map) - CentreOf(b, *map)).norm() <=
             limit->second * std::abs(a.timestamp_s - b.timestamp_s);
}

bool KnownPoses::IsPlausible(const AnchoredPose& pose) const {
  const auto next = by_stamp_.upper_bound(pose.timestamp_s);
  return (next == by_stamp_.end() || IsReachable(next->second, pose)) &&
         (next == by_stamp_.begin() || IsReachable(std::prev(next)->second, pose));
}

}  // namespace dynamic_slam
