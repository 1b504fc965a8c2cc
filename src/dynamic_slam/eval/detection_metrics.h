#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "dynamic_slam/io/box_file.h"

namespace dynamic_slam {

struct DetectionMetricsOptions {
  std::string class_name = "person";  // others are not looked at; all are when it is empty
  double min_iou = 0.5;
  double min_score = 0;      // of found boxes
  double min_visible = 0.5;  // truth that shows less of its object is neither a hit nor a miss
};

// How found boxes compare to the true ones. Rates of nothing are 1: nothing was missed, nothing was wrong.
struct DetectionMetrics {
  size_t hits = 0;          // TP: true boxes that were found
  size_t misses = 0;        // FN: true boxes that were not
  size_t false_alarms = 0;  // FP: found boxes without a true one
  size_t ignored = 0;       // found boxes on truth that is hardly visible

  // Frames with a true box: all; those in which at least one was found, which is what section 4.1 of the
  // paper counts; and those in which all were.
  size_t frames = 0, frames_hit = 0, frames_complete = 0;

  double Recall() const { return Share(hits, hits + misses); }  // Eq. (1)
  double MissRate() const { return 1 - Recall(); }              // Eq. (2)
  double Precision() const { return Share(hits, hits + false_alarms); }
  double FrameRecall() const { return Share(frames_hit, frames); }
  double CompleteFrameRecall() const { return Share(frames_complete, frames); }

  DetectionMetrics& operator+=(const DetectionMetrics& other);

 private:
  static double Share(size_t part, size_t all) {
    return all == 0 ? 1.0 : static_cast<double>(part) / static_cast<double>(all);
  }
};

// The boxes of one frame, whatever their stamps. Best score first, each found box takes the true box of its
// class that it overlaps most, by at least min_iou, of those that are not taken, hardly visible ones
// included: so a box that fits a hidden object best is never counted as the one in front of it.
DetectionMetrics CompareFrame(std::span<const BoxRecord> truth, std::span<const BoxRecord> found,
                              const DetectionMetricsOptions& options);

// All frames; boxes belong to the same frame when their stamps are equal to the microsecond.
DetectionMetrics CompareBoxes(std::span<const BoxRecord> truth, std::span<const BoxRecord> found,
                              const DetectionMetricsOptions& options);

}  // namespace dynamic_slam
