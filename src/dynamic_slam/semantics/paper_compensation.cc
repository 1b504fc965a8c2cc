#include "dynamic_slam/semantics/paper_compensation.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace dynamic_slam {
namespace {

constexpr int kMaxDetections = 100;

Eigen::Vector2d Centre(const Box& box) { return {box.CenterX(), box.CenterY()}; }

// A box and a detection that may be the same object.
struct Pair {
  double distance_px = 0;
  size_t box = 0, detection = 0;
  bool operator<(const Pair& other) const {
    return std::tie(distance_px, box, detection) < std::tie(other.distance_px, other.box, other.detection);
  }
};

}  // namespace

PaperCompensation::PaperCompensation(const PaperCompensationOptions& options, const Camera& camera)
    : options_(options), camera_(camera) {
  // An acceleration: pixels grow with the width, frames^2 fall with the square of the rate.
  const double fps = camera.fps > 0 ? camera.fps : 30;
  a_max_px_ = options.max_acceleration_px * std::pow(30 / fps, 2) * camera.width / 640;
}

std::vector<Detection> PaperCompensation::Usable(std::span<const Detection> detections) const {
  return UsableDetections(detections, camera_, options_.min_score, kMaxDetections, 1.0);
}

Eigen::Vector2d PaperCompensation::MeanDisplacement(const PaperBox& box) const {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& displacement : box.displacements_px) sum += displacement;
  return box.displacements_px.empty() ? sum : sum / static_cast<double>(box.displacements_px.size());
}

void PaperCompensation::Advance(const CompensationInput& input, std::vector<PaperBox>* boxes) {
  const std::vector<Detection> detections = input.detections.value_or(std::vector<Detection>());

  // Lines 2 to 5 of Algorithm 1: which detections are in the area of which box.
  std::vector<Pair> pairs;
  for (size_t i = 0; i < boxes->size(); ++i) {
    const PaperBox& box = (*boxes)[i];
    const Eigen::Vector2d predicted = Centre(box.box.box) + MeanDisplacement(box);  // Eq. (6)
    for (size_t l = 0; l < detections.size(); ++l) {
      if (detections[l].class_id != box.box.class_id) continue;
      const Eigen::Vector2d difference = Centre(detections[l].box) - predicted;
      // Eq. (5): the area reaches a_max / 2 to either side, so that its width is the bound of Eq. (4).
      if (difference.cwiseAbs().maxCoeff() <= 0.5 * a_max_px_) pairs.push_back({difference.norm(), i, l});
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<const Detection*> detection_of(boxes->size(), nullptr);
  std::vector<bool> is_taken(detections.size(), false);
  for (const Pair& pair : pairs) {
    if (detection_of[pair.box] != nullptr || is_taken[pair.detection]) continue;
    detection_of[pair.box] = &detections[pair.detection];
    is_taken[pair.detection] = true;
  }

  std::vector<PaperBox> next;
  for (size_t i = 0; i < boxes->size(); ++i) {
    PaperBox box = std::move((*boxes)[i]);
    Eigen::Vector2d displacement = MeanDisplacement(box);
    box.box.is_detected = detection_of[i] != nullptr;
    ++box.box.age_frames;
    if (box.box.is_detected) {  // line 6
      displacement = Centre(detection_of[i]->box) - Centre(box.box.box);
      box.box.box = detection_of[i]->box;
      box.box.score = detection_of[i]->score;
      box.box.missed_frames = 0;
    } else {  // lines 7 to 9: moved by Eq. (6), with the last width and height
      box.box.box.x += displacement.x();
      box.box.box.y += displacement.y();
      ++box.box.missed_frames;
    }
    box.displacements_px.push_back(displacement);
    if (box.displacements_px.size() > static_cast<size_t>(options_.mean_frames)) {
      box.displacements_px.erase(box.displacements_px.begin());
    }
    const bool is_in_image = ClipToImage(box.box.box, camera_).Area() > 0;
    if (box.box.missed_frames <= options_.max_misses && is_in_image) next.push_back(std::move(box));
  }
  for (size_t l = 0; l < detections.size(); ++l) {
    if (is_taken[l]) continue;
    const Detection& detection = detections[l];
    next.push_back({{detection.box, detection.class_id, detection.score, NextTrackId(), true, 1, 0}, {}});
  }
  *boxes = std::move(next);
}

std::vector<CompensatedBox> PaperCompensation::BoxesOf(const std::vector<PaperBox>& boxes) const {
  std::vector<CompensatedBox> result;
  for (const PaperBox& box : boxes) {
    result.push_back(box.box);
    result.back().box = ClipToImage(box.box.box, camera_);
  }
  return result;
}

}  // namespace dynamic_slam
