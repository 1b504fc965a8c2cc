#include "dynamic_slam/eval/detection_metrics.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>

namespace dynamic_slam {

DetectionMetrics& DetectionMetrics::operator+=(const DetectionMetrics& other) {
  hits += other.hits;
  misses += other.misses;
  false_alarms += other.false_alarms;
  ignored += other.ignored;
  frames += other.frames;
  frames_hit += other.frames_hit;
  frames_complete += other.frames_complete;
  return *this;
}

DetectionMetrics CompareFrame(std::span<const BoxRecord> truth, std::span<const BoxRecord> found,
                              const DetectionMetricsOptions& options) {
  const auto is_wanted = [&](const BoxRecord& record) {
    return options.class_name.empty() || record.class_name == options.class_name;
  };
  std::vector<const BoxRecord*> targets, candidates;
  for (const BoxRecord& record : truth) {
    if (is_wanted(record)) targets.push_back(&record);
  }
  for (const BoxRecord& record : found) {
    if (is_wanted(record) && record.score >= options.min_score) candidates.push_back(&record);
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const BoxRecord* a, const BoxRecord* b) { return a->score > b->score; });

  const auto counts = [&](size_t target) { return targets[target]->visible >= options.min_visible; };
  std::vector<bool> is_taken(targets.size(), false);
  DetectionMetrics metrics;
  for (const BoxRecord* candidate : candidates) {
    size_t best = targets.size();
    double best_iou = 0;
    for (size_t t = 0; t < targets.size(); ++t) {
      if (is_taken[t] || targets[t]->class_name != candidate->class_name) continue;
      const double iou = IoU(targets[t]->box, candidate->box);
      if (iou < options.min_iou || iou <= best_iou) continue;
      best = t;
      best_iou = iou;
    }
    if (best == targets.size()) {
      ++metrics.false_alarms;
    } else {
      is_taken[best] = true;
      ++(counts(best) ? metrics.hits : metrics.ignored);
    }
  }
  for (size_t t = 0; t < targets.size(); ++t) {
    if (counts(t) && !is_taken[t]) ++metrics.misses;
  }
  if (metrics.hits + metrics.misses > 0) {
    metrics.frames = 1;
    metrics.frames_hit = metrics.hits > 0 ? 1 : 0;
    metrics.frames_complete = metrics.misses == 0 ? 1 : 0;
  }
  return metrics;
}

DetectionMetrics CompareBoxes(std::span<const BoxRecord> truth, std::span<const BoxRecord> found,
                              const DetectionMetricsOptions& options) {
  struct Frame {
    std::vector<BoxRecord> truth, found;
  };
  std::map<int64_t, Frame> frames;  // by microseconds
  const auto frame_of = [&](const BoxRecord& record) -> Frame& {
    return frames[std::llround(record.timestamp_s * 1e6)];
  };
  for (const BoxRecord& record : truth) frame_of(record).truth.push_back(record);
  for (const BoxRecord& record : found) frame_of(record).found.push_back(record);
  DetectionMetrics metrics;
  for (const auto& [stamp, frame] : frames) metrics += CompareFrame(frame.truth, frame.found, options);
  return metrics;
}

}  // namespace dynamic_slam
