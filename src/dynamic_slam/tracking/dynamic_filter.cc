#include "dynamic_slam/tracking/dynamic_filter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {
namespace {

// A corner is found where a circle of this radius, in px of its octave, differs from its centre (Rosten and
// Drummond 2006): so near to an outline it is made of the object and of what is behind it, and moves with neither.
constexpr double kCornerRadius = 3;

bool Contains(const Box& box, double x, double y, double margin_px) {
  return x >= box.x - margin_px && y >= box.y - margin_px && x < box.x + box.width + margin_px &&
         y < box.y + box.height + margin_px;
}

}  // namespace

DynamicFilter::DynamicFilter(const Camera& camera, const DynamicOptions& options,
                             std::vector<float> octave_scales)
    : camera_(camera), options_(options), octave_scales_(std::move(octave_scales)) {}

float DynamicFilter::Evidence(float static_probability, bool fits) const {
  if (!options_.landmark_odds || static_probability <= 0 || static_probability >= 1) return 0;
  // Of what is at rest nearly all fits; of what moves some does by chance, as it stops or as windows are narrow.
  constexpr double kFitsAtRest = 0.95, kFitsMoving = 0.35;
  const double seen =
      fits ? std::log(kFitsAtRest / kFitsMoving) : std::log((1 - kFitsAtRest) / (1 - kFitsMoving));
  // Frames that follow each other tell nearly the same.
  constexpr double kNews = 0.1;
  return static_cast<float>(kNews * (seen + std::log(static_probability / (1.0 - static_probability))));
}

bool DynamicFilter::IsHidden(const Eigen::Vector2d& ideal_px) const {
  if (boxes_.empty()) return false;
  const Eigen::Vector2d px = camera_.Distort(ideal_px);
  return std::any_of(boxes_.begin(), boxes_.end(),
                     [&](const DynamicBox& box) { return box.box.box.Contains(px.x(), px.y()); });
}

DynamicKeypoints DynamicFilter::Judge(std::span<const DynamicBox> boxes, Frame* frame) {
  boxes_.clear();
  if (options_.method != "none") {
    for (const DynamicBox& box : boxes) {
      if (box.is_dynamic) boxes_.push_back(box);
    }
  }
  DynamicKeypoints counts;
  const bool weights = options_.method == "weights";
  frame->static_probability.resize(frame->features.size());
  for (size_t i = 0; i < frame->features.size(); ++i) {
    const Keypoint& keypoint = frame->features.keypoints[i];
    const double outline_px = kCornerRadius * octave_scales_[static_cast<size_t>(keypoint.octave)];
    double at_rest = 1;
    bool in_box = false;
    for (const DynamicBox& box : boxes_) {
      const Box& b = box.box.box;
      const double margin_px = outline_px + options_.margin_ratio * std::sqrt(b.Area());
      if (!Contains(b, keypoint.raw_x, keypoint.raw_y, weights ? margin_px : 0)) continue;
      in_box = true;
      at_rest *= 1 - box.probability * options_.object_share;
    }
    if (weights) {
      frame->static_probability[i] = static_cast<float>(std::min(at_rest, 1 - options_.missed_object));
    } else {
      frame->static_probability[i] = in_box ? 0.0f : 1.0f;
    }
    ++(in_box ? counts.culled : counts.outside);
  }
  return counts;
}

}  // namespace dynamic_slam
