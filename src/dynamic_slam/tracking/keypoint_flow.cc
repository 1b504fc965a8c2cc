#include "dynamic_slam/tracking/keypoint_flow.h"

#include <algorithm>
#include <cmath>

#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/tracking/witnesses.h"

namespace dynamic_slam {
namespace {

// In the time between two frames, s: with more there is too much that looks alike, with less they are told
// apart by their noise.
constexpr double kMinInterval_s = 1.0 / 60, kMaxInterval_s = 0.1;

// Nearest over second nearest distance.
constexpr double kRatio = 0.8;

}  // namespace

void KeypointFlow::Clear(const Frame& frame) {
  is_of_witnesses_ = false;
  last_keypoints_.assign(frame.features.size(), kNotFollowed);
  distances_.assign(frame.features.size(), kStrictDistance + 1);
  followed_.clear();
  motions_.clear();
}

void KeypointFlow::Match(const Frame& last, std::span<const Box> boxes,
                         const std::optional<Eigen::Quaterniond>& frame_from_last, const Frame& frame,
                         Of of) {
  before_.swap(last_keypoints_);
  Clear(frame);
  if (boxes.empty()) return;
  const double interval_s = std::clamp(frame.timestamp_s - last.timestamp_s, kMinInterval_s, kMaxInterval_s);
  radius_px_ = camera_.fx * kMaxRate_rad_s * interval_s;
  const Eigen::Matrix3d rotation =
      frame_from_last.value_or(Eigen::Quaterniond::Identity()).toRotationMatrix();
  const size_t n = last.features.size();
  near_.Begin(last.features);
  for (const Box& box : boxes) near_.Mark(box, kReach * std::sqrt(box.Area()), {}, WitnessesOf(box));
  is_of_witnesses_ = of == Of::kWitnesses;
  if (is_of_witnesses_) {
    if (before_.size() != n) before_.assign(n, kNotFollowed);  // of another frame
    ChooseWitnesses(last, near_.bits(), before_, &asked_);
  } else {
    asked_.clear();
    for (uint32_t i = 0; i < n; ++i) {
      if (near_.bits()[i] != 0) asked_.push_back(i);
    }
  }
  for (const uint32_t i : asked_) {
    const Keypoint& from = last.features.keypoints[i];
    const Eigen::Vector3d ray = rotation * camera_.Unproject({from.x, from.y});
    if (ray.z() <= 0) continue;
    const Eigen::Vector2d px = camera_.Project(ray);
    const SearchWindow window{static_cast<float>(px.x()), static_cast<float>(px.y()),
                              static_cast<float>(radius_px_), from.octave - 1, from.octave + 1};
    const WindowMatch match =
        FindInWindow(frame.features, frame.grid, window, last.features.descriptors[i], {});
    if (!match.Found() || match.distance >= distances_[match.keypoint]) continue;
    if (match.distance > kRatio * match.second_distance && match.octave == match.second_octave) continue;
    distances_[match.keypoint] = match.distance;
    last_keypoints_[match.keypoint] = i;
  }
  // Without branches: which of them are is hard to predict.
  followed_.resize(last_keypoints_.size());
  size_t count = 0;
  for (uint32_t i = 0; i < last_keypoints_.size(); ++i) {
    followed_[count] = i;
    count += static_cast<size_t>(last_keypoints_[i] != kNotFollowed);
  }
  followed_.resize(count);
  for (const uint32_t i : followed_) {
    const Keypoint& from = last.features.keypoints[last_keypoints_[i]];
    const Keypoint& to = frame.features.keypoints[i];
    motions_.push_back({{from.raw_x, from.raw_y}, {to.raw_x, to.raw_y}});
  }
}

}  // namespace dynamic_slam
