#include "dynamic_slam/tracking/past_views.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/geometry/segment.h"

namespace dynamic_slam {
namespace {

// So long before the frame its keypoints are looked for. The longer, the farther a mover is apart, but the
// fewer corners are found again. One after the other in successive frames: in one frame all three tell nearly
// the same, at three times the cost.
constexpr double kAges_s[] = {0.07, 0.13, 0.19};
constexpr double kMaxAge_s = 0.25;

// Of the noise of a corner's place, over one pixel of its octave.
constexpr double kGate = 2.5;

// The parts of an object move beside it by so much of its motion (limbs).
constexpr double kLimbs = 0.4;

// Bits by which a descriptor must fit better at one place than at the other.
constexpr int kClearlyBetter = 8;

// An object's motion is believed when so many of its keypoints were found where it says, and so many for each
// that was found at rest: else the motion was measured wrongly, and all in its box fits rest.
constexpr int kMinWitnesses = 6;
constexpr double kMinWitnessShare = 0.6;

// Log-odds of a keypoint found at rest, or with an object. Measured among real and rendered people: at rest
// 18 to 26% of what is at rest is found and 1 to 4% of what moves, with the object 35 to 49% and 1 to 2%; so
// 1.9 to 2.9, and 3.2 to 3.5.
constexpr float kAtRest = 2, kWithObject = 3, kMostEvidence = 3;

// Neighbours in the image mostly belong to the same surface, beside a box too: limbs reach out of it.
constexpr float kNeighbourRadius_px = 12;

constexpr size_t kMaxObjects = 64;  // bits of a word; what lies in others is not told apart

}  // namespace

void ShiftHistory::Add(const Eigen::Vector2d& shift_px) {
  if (size_ == shifts_px_.size()) {
    std::move(shifts_px_.begin() + 1, shifts_px_.end(), shifts_px_.begin());
    --size_;
  }
  shifts_px_[size_++] = shift_px;
}

std::optional<Eigen::Vector2d> ShiftHistory::Sum(size_t steps) const {
  if (steps > size_) return std::nullopt;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (size_t i = size_ - steps; i < size_; ++i) sum += shifts_px_[i];
  return sum;
}

void PastViews::ForgetUnlessNext(const Frame& frame) {
  if (count_ > 0 && views_[count_ - 1].id.value() + 1 != frame.id.value()) Clear();
}

void PastViews::Add(const Frame& frame) {
  ForgetUnlessNext(frame);
  size_t old = 0;
  while (old < count_ && views_[old].timestamp_s < frame.timestamp_s - kMaxAge_s) ++old;
  std::rotate(views_.begin(), views_.begin() + static_cast<std::ptrdiff_t>(old), views_.end());
  count_ -= old;
  if (count_ == views_.size()) views_.emplace_back();
  View& view = views_[count_++];
  view.id = frame.id;
  view.timestamp_s = frame.timestamp_s;
  view.descriptors = frame.features.descriptors;
  view.grid = frame.grid;
  view.cam_from_world = frame.cam_from_world;
}

const PastViews::View* PastViews::FromBefore(const Frame& frame, double age_s) const {
  const View* nearest = nullptr;
  const auto misfit_s = [&](const View& view) {
    return std::abs(frame.timestamp_s - view.timestamp_s - age_s);
  };
  for (size_t i = 0; i < count_; ++i) {
    if (nearest == nullptr || misfit_s(views_[i]) < misfit_s(*nearest)) nearest = &views_[i];
  }
  return nearest;
}

std::span<const float> PastViews::Judge(const Frame& frame, std::span<const uint32_t> asked,
                                        std::span<const Object> objects, double nearest_depth) {
  objects = objects.first(std::min(objects.size(), kMaxObjects));
  evidence_.assign(frame.features.size(), 0.0f);
  ForgetUnlessNext(frame);
  const double age_s = kAges_s[frame.id.value() % std::size(kAges_s)];
  if (const View* view = FromBefore(frame, age_s)) Ask(*view, frame, asked, objects, nearest_depth);
  ShareWithNeighbours(frame);
  return evidence_;
}

void PastViews::Ask(const View& view, const Frame& frame, std::span<const uint32_t> asked,
                    std::span<const Object> objects, double nearest_depth) {
  const Rigid3 view_from_frame = view.cam_from_world * frame.cam_from_world.Inverse();
  const Eigen::Matrix3d rotation = view_from_frame.Matrix();
  const size_t steps = frame.id.value() - view.id.value();
  const size_t n = frame.features.size();
  looks_.assign(n, 0);
  carriers_.assign(n, 0);
  std::array<int, kMaxObjects> at_rest{}, with_object{};
  std::array<std::optional<Eigen::Vector2d>, kMaxObjects> shifts_px;
  for (size_t k = 0; k < objects.size(); ++k) shifts_px[k] = objects[k].shifts->Sum(steps);
  for (const uint32_t i : asked) {
    const Keypoint& keypoint = frame.features.keypoints[i];
    const double scale = octave_scales_[static_cast<size_t>(keypoint.octave)];
    uint64_t boxes = 0;  // bits: those that it is in
    for (size_t k = 0; k < objects.size(); ++k) {
      const bool is_in = objects[k].box.Contains(keypoint.raw_x, keypoint.raw_y,
                                                 objects[k].margin_px + kCornerRadius * scale);
      boxes |= uint64_t{is_in} << k;
    }
    if (boxes == 0) continue;
    const Descriptor& descriptor = frame.features.descriptors[i];
    const Eigen::Vector2d px(keypoint.x, keypoint.y);
    const double radius_px = kGate * std::numbers::sqrt2 * scale;
    // At rest it was on the epipolar line between infinity and the nearest depth, or where its landmark is.
    const Eigen::Vector3d far = rotation * camera_.Unproject(px);
    const Eigen::Vector3d near = nearest_depth * far + view_from_frame.translation;
    if (far.z() <= 0 || near.z() <= 0) continue;
    Eigen::Vector2d far_px = camera_.Project(far), near_px = camera_.Project(near);
    if (frame.landmarks[i].IsValid()) {
      const Eigen::Vector3d known = view.cam_from_world * frame.points[i];
      if (known.z() > 0) far_px = near_px = camera_.Project(known);
    }
    int with_any = 257;
    bool is_clear = true;
    for (size_t k = 0; k < objects.size(); ++k) {
      if ((boxes >> k & 1) == 0) continue;
      const Eigen::Vector2d carried_px = px - shifts_px[k].value_or(Eigen::Vector2d::Zero());
      const double apart_px = shifts_px[k] ? DistanceToSegment(carried_px, far_px, near_px) : 0;
      // Nobody can tell who stands still, or is not known to move, from what is behind.
      if (apart_px < 2 * radius_px) {
        is_clear = false;
        continue;
      }
      carriers_[i] |= uint64_t{1} << k;
      const double reach_px = std::min(std::max(radius_px, kLimbs * apart_px), apart_px - radius_px);
      const int distance = view.Nearest(descriptor, keypoint.octave, carried_px, carried_px, reach_px);
      with_object[k] += distance <= kStrictDistance;
      with_any = std::min(with_any, distance);
    }
    // What was not found with an object and may belong to one who stands still tells nothing either way.
    if (carriers_[i] == 0 || (!is_clear && with_any > kStrictDistance)) continue;
    const int distance = view.Nearest(descriptor, keypoint.octave, far_px, near_px, radius_px);
    if (distance <= kStrictDistance && is_clear) {
      for (size_t k = 0; k < objects.size(); ++k) at_rest[k] += static_cast<int>(carriers_[i] >> k & 1);
      looks_[i] = distance + kClearlyBetter <= with_any ? 1 : 0;
    }
    if (with_any <= kStrictDistance && with_any + kClearlyBetter <= distance) looks_[i] = -1;
  }
  uint64_t believed = 0;
  for (size_t k = 0; k < objects.size(); ++k) {
    if (with_object[k] >= kMinWitnesses && with_object[k] >= kMinWitnessShare * at_rest[k]) {
      believed |= uint64_t{1} << k;
    }
  }
  for (size_t i = 0; i < n; ++i) {
    const bool is_told = looks_[i] > 0   ? (carriers_[i] & ~believed) == 0
                         : looks_[i] < 0 ? (carriers_[i] & believed) != 0
                                         : false;
    if (is_told) evidence_[i] = looks_[i] > 0 ? kAtRest : -kWithObject;
  }
}

DS_DISPATCH_POPCNT
int PastViews::View::Nearest(const Descriptor& descriptor, int octave, const Eigen::Vector2d& a,
                             const Eigen::Vector2d& b, double radius_px) const {
  int nearest = 257;
  grid.ForEachAlong(
      a.cast<float>(), b.cast<float>(), static_cast<float>(radius_px), octave - 1,
      octave + 1, [&](uint32_t j) __attribute__((always_inline)) {
        nearest = std::min(nearest, HammingDistance(descriptor, descriptors[j]));
      });
  return nearest;
}

void PastViews::ShareWithNeighbours(const Frame& frame) {
  const size_t n = evidence_.size();
  neighbours_sum_.assign(n, 0.0f);
  neighbours_.assign(n, 0);
  const int octaves = static_cast<int>(octave_scales_.size());
  // From those that know to those around them, as few know.
  for (uint32_t i = 0; i < n; ++i) {
    if (evidence_[i] == 0) continue;
    const Keypoint& keypoint = frame.features.keypoints[i];
    frame.grid.ForEachInWindow(keypoint.x, keypoint.y, kNeighbourRadius_px, 0, octaves, [&](uint32_t j) {
      if (j == i) return;
      neighbours_sum_[j] += evidence_[i];
      ++neighbours_[j];
    });
  }
  for (size_t i = 0; i < n; ++i) {
    // Their mean, the less the fewer they are.
    const float mean = neighbours_sum_[i] / static_cast<float>(neighbours_[i] + 1);
    evidence_[i] = std::clamp(evidence_[i] + mean, -kMostEvidence, kMostEvidence);
  }
}

}  // namespace dynamic_slam
