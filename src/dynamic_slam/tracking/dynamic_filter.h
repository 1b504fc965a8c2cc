#pragma once

#include <span>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/semantics/dynamic_score.h"
#include "dynamic_slam/tracking/dynamic_options.h"
#include "dynamic_slam/tracking/keypoint_flow.h"

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
  DynamicFilter(const Camera& camera, const DynamicOptions& options, std::vector<float> octave_scales);

  // Fills in frame->static_probability. boxes: all objects of the frame; only dynamic ones count. flow: from
  // the last frame to this one, matched with Boxes() of the last one.
  DynamicKeypoints Judge(std::span<const DynamicBox> boxes, const KeypointFlow& flow, const Frame& last,
                         Frame* frame);

  // When the pose is known: which keypoints in and around boxes moved as what is at rest does, and which as
  // the object. Changes frame->static_probability.
  void Watch(const KeypointFlow& flow, const Frame& last, double median_depth, Frame* frame);

  // The dynamic boxes of the last Judge.
  std::vector<Box> Boxes() const;

  // Whether a point of the frame (ideal px) is in one of its dynamic boxes.
  bool IsHidden(const Eigen::Vector2d& ideal_px) const;

  // What a frame adds to the log-odds of a landmark that was matched with a keypoint, and fits the pose or
  // not.
  float Evidence(float static_probability, bool fits) const;

  // Forgets the boxes of earlier frames.
  void Reset();

  bool HasBoxes() const { return !boxes_.empty(); }

  const DynamicOptions& options() const { return options_; }

 private:
  void JudgeByDisplacement(const KeypointFlow& flow, const Frame& last, Frame* frame) const;
  float Combine(float prior, float motion_log_odds) const;

  Camera camera_;
  DynamicOptions options_;
  std::vector<float> octave_scales_;
  std::vector<DynamicBox> boxes_, last_boxes_;
  std::vector<float> prior_;  // P(at rest) of each keypoint by the boxes alone
};

}  // namespace dynamic_slam
