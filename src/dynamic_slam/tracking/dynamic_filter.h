#pragma once

#include <span>
#include <vector>

#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/semantics/dynamic_score.h"
#include "dynamic_slam/tracking/dynamic_options.h"

namespace dynamic_slam {

// How a frame's keypoints were judged (Fig. 9).
struct DynamicKeypoints {
  int outside = 0;  // in no dynamic box
  int kept = 0;     // in one, but used
  int culled = 0;

  int InBoxes() const { return kept + culled; }
};

// How far the frame's keypoints can be trusted to show something at rest.
class DynamicFilter {
 public:
  explicit DynamicFilter(const DynamicOptions& options) : options_(options) {}

  // Fills in frame->static_probability. boxes: all objects of the frame; only dynamic ones count.
  DynamicKeypoints Judge(std::span<const DynamicBox> boxes, Frame* frame);

  // P(a keypoint at this place (raw px) shows something at rest), by the boxes of the last Judge.
  float PriorAt(double raw_x, double raw_y) const;

  bool HasBoxes() const { return !boxes_.empty(); }

  // Whether the place is in a dynamic box of the last Judge.
  bool IsInBox(double raw_x, double raw_y) const;

  // What a frame adds to the log-odds of a landmark that was matched with a keypoint, and fits the pose or not.
  float Evidence(float static_probability, bool fits) const;
  static constexpr float kMaxLogOdds = 4;

  const DynamicOptions& options() const { return options_; }

 private:
  DynamicOptions options_;
  std::vector<DynamicBox> boxes_;
};

// P(at rest) of a match: of a keypoint, and the log-odds of the landmark that it shows. It is the match's weight
// in the optimisation of poses.
double TrustInMatch(float static_probability, float static_log_odds);

}  // namespace dynamic_slam
