#include "dynamic_slam/semantics/box_compensation.h"

#include <algorithm>
#include <cmath>

namespace dynamic_slam {
namespace {

bool MakesSense(const Detection& detection) {
  const Box& box = detection.box;
  return std::isfinite(box.x) && std::isfinite(box.y) && std::isfinite(box.width) &&
         std::isfinite(box.height) && detection.score >= 0 && detection.score <= 1 && detection.class_id >= 0;
}

}  // namespace

Box ClipToImage(const Box& box, const Camera& camera) {
  const double left = std::clamp(box.x, 0.0, static_cast<double>(camera.width));
  const double top = std::clamp(box.y, 0.0, static_cast<double>(camera.height));
  const double right = std::clamp(box.x + box.width, left, static_cast<double>(camera.width));
  const double bottom = std::clamp(box.y + box.height, top, static_cast<double>(camera.height));
  return {left, top, right - left, bottom - top};
}

std::vector<Detection> UsableDetections(std::span<const Detection> detections, const Camera& camera,
                                        double min_score, int max_count, double max_iou) {
  std::vector<Detection> candidates;
  for (const Detection& detection : detections) {
    if (!MakesSense(detection) || detection.score < min_score) continue;
    const Box clipped = ClipToImage(detection.box, camera);
    if (clipped.width >= 1 && clipped.height >= 1) {
      candidates.push_back({clipped, detection.class_id, detection.score});
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Detection& a, const Detection& b) { return a.score > b.score; });
  std::vector<Detection> usable;
  // Duplicates are looked for among the best ones only, which bounds the time.
  if (candidates.size() > static_cast<size_t>(4 * max_count)) candidates.resize(4 * max_count);
  for (const Detection& candidate : candidates) {
    if (usable.size() == static_cast<size_t>(max_count)) break;
    const bool is_duplicate = std::any_of(usable.begin(), usable.end(), [&](const Detection& better) {
      return better.class_id == candidate.class_id && IoU(better.box, candidate.box) > max_iou;
    });
    if (!is_duplicate) usable.push_back(candidate);
  }
  return usable;
}

}  // namespace dynamic_slam
