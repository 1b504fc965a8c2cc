#include "dynamic_slam/semantics/sanitise.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace dynamic_slam {
namespace {

// A network whose threshold is 0 gives some 100,000; comparing all with all would take minutes.
constexpr size_t kMaxCandidates = 1000;

bool IsFinite(const Detection& d) {
  return std::isfinite(d.box.x) && std::isfinite(d.box.y) && std::isfinite(d.box.width) &&
         std::isfinite(d.box.height) && std::isfinite(d.score);
}

Box Clipped(const Box& box, const cv::Size& image_px) {
  const double left = std::max(box.x, 0.0), top = std::max(box.y, 0.0);
  const double right = std::min(box.x + box.width, static_cast<double>(image_px.width));
  const double bottom = std::min(box.y + box.height, static_cast<double>(image_px.height));
  return {left, top, right - left, bottom - top};
}

}  // namespace

void SortByScore(std::vector<Detection>* detections) {
  const auto key = [](const Detection& d) {
    return std::tuple(-d.score, d.class_id, d.box.x, d.box.y, d.box.width, d.box.height);
  };
  std::sort(detections->begin(), detections->end(),
            [&key](const Detection& a, const Detection& b) { return key(a) < key(b); });
}

std::vector<Detection> Sanitise(std::vector<Detection> detections, const cv::Size& image_px, size_t classes,
                                size_t max_detections) {
  std::erase_if(detections, [&image_px, classes](Detection& d) {
    if (!IsFinite(d) || d.class_id < 0 || static_cast<size_t>(d.class_id) >= classes) return true;
    d.score = std::clamp(d.score, 0.0, 1.0);
    d.box = Clipped(d.box, image_px);
    return !(d.box.width > 0 && d.box.height > 0);
  });
  SortByScore(&detections);
  if (detections.size() > max_detections) detections.resize(max_detections);
  return detections;
}

std::vector<Detection> SuppressNonMaxima(std::vector<Detection> detections, double max_iou) {
  SortByScore(&detections);
  if (detections.size() > kMaxCandidates) detections.resize(kMaxCandidates);
  std::vector<Detection> kept;
  for (const Detection& candidate : detections) {
    const bool is_covered = std::any_of(kept.begin(), kept.end(), [&](const Detection& better) {
      return better.class_id == candidate.class_id && IoU(better.box, candidate.box) > max_iou;
    });
    if (!is_covered) kept.push_back(candidate);
  }
  return kept;
}

}  // namespace dynamic_slam
