#include "dynamic_slam/tracking/dynamic_filter.h"

#include <algorithm>
#include <cmath>

namespace dynamic_slam {

double TrustInMatch(float static_probability, float static_log_odds) {
  if (static_probability >= 1) return 1;
  const double odds = static_probability / (1.0 - static_probability) * std::exp(static_log_odds);
  return odds / (1 + odds);
}

float DynamicFilter::Evidence(float static_probability, bool fits) const {
  if (!options_.landmark_odds || static_probability <= 0 || static_probability >= 1) return 0;
  // Of what is at rest nearly all fits; of what moves some does by chance, as it stops or as windows are narrow.
  constexpr double kFitsAtRest = 0.95, kFitsMoving = 0.35;
  const double seen = fits ? std::log(kFitsAtRest / kFitsMoving) : std::log((1 - kFitsAtRest) / (1 - kFitsMoving));
  // Frames that follow each other tell nearly the same.
  constexpr double kNews = 0.1;
  return static_cast<float>(kNews * (seen + std::log(static_probability / (1.0 - static_probability))));
}

bool DynamicFilter::IsInBox(double raw_x, double raw_y) const {
  return std::any_of(boxes_.begin(), boxes_.end(),
                     [&](const DynamicBox& box) { return box.box.box.Contains(raw_x, raw_y); });
}

float DynamicFilter::PriorAt(double raw_x, double raw_y) const {
  double p = 1;
  for (const DynamicBox& box : boxes_) {
    if (box.box.box.Contains(raw_x, raw_y)) p *= 1.0 - box.probability * options_.object_share;
  }
  return static_cast<float>(std::clamp(p, 0.01, 1.0 - options_.missed_object));
}

DynamicKeypoints DynamicFilter::Judge(std::span<const DynamicBox> boxes, Frame* frame) {
  boxes_.clear();
  DynamicKeypoints counts;
  const size_t n = frame->features.size();
  frame->static_probability.assign(n, 1.0f);
  if (options_.method != "none") {
    for (const DynamicBox& box : boxes) {
      if (box.is_dynamic) boxes_.push_back(box);
    }
  }
  const bool weights = options_.method == "weights";
  for (size_t i = 0; i < n; ++i) {
    const Keypoint& keypoint = frame->features.keypoints[i];
    const bool in_box = IsInBox(keypoint.raw_x, keypoint.raw_y);
    if (!in_box) {
      ++counts.outside;
    } else {
      ++counts.culled;
    }
    if (weights) {
      frame->static_probability[i] = PriorAt(keypoint.raw_x, keypoint.raw_y);
    } else {
      frame->static_probability[i] = in_box ? 0.0f : 1.0f;
    }
  }
  return counts;
}

}  // namespace dynamic_slam
