#pragma once

#include <utility>
#include <vector>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/semantics/box_filter.h"
#include "dynamic_slam/semantics/replaying_compensation.h"

namespace dynamic_slam {

struct TrackerCompensationOptions {
  double min_score = 0.4;
  double neutral_score = 0.45;
  double max_evidence = 6.0;
  double miss_evidence = 1.5;
  double hidden_evidence = 0.2;
  double max_unseen_s = 1.5;
  double min_iou = 0.3;
  double max_duplicate_iou = 0.7;
  int max_boxes = 100;
  BoxFilterOptions filter;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("min_score", self.min_score,
          OptionField{"", 0, 1, "Detections with a lower score are not looked at."});
    visit("neutral_score", self.neutral_score,
          OptionField{"", 0.01, 0.99, "A detection with this score or less says nothing new of an object."});
    visit("max_evidence", self.max_evidence,
          OptionField{"", 0, 20, "Log-odds grow no further; over miss_evidence, the misses one outlives."});
    visit("miss_evidence", self.miss_evidence,
          OptionField{"", 0.01, 20, "What a result without the object takes off its log-odds."});
    visit("hidden_evidence", self.hidden_evidence,
          OptionField{"", 0.01, 20, "The same of an object that is behind one that it was seen beside."});
    visit("max_unseen_s", self.max_unseen_s,
          OptionField{"s", 0, 10, "An object is given up when it was not seen for longer."});
    visit("min_iou", self.min_iou,
          OptionField{"", 0, 1,
                      "Least overlap of a detection with the place predicted for an object; less is enough "
                      "where the prediction is uncertain."});
    visit("max_duplicate_iou", self.max_duplicate_iou,
          OptionField{"", 0, 1, "Boxes of one class with a larger overlap are one object."});
    visit("max_boxes", self.max_boxes,
          OptionField{"", 1, 1000, "Only so many detections, the best, and objects are looked at."});
    visit("filter", self.filter);
  }
};

// One object over time.
struct BoxTrack {
  BoxTrack(int new_id, const BoxFilter& new_filter) : id(new_id), filter(new_filter) {}

  int id;
  BoxFilter filter;
  std::vector<std::pair<int, double>> class_votes;  // class id, sum of its scores
  double evidence = 0;                              // log-odds of there being such an object
  Detection seen;                                   // the last detection of it
  bool is_detected = false;                         // in the last frame
  double unseen_s = 0;
  int age_frames = 0, missed_frames = 0;
  std::vector<std::pair<int, int>> frames_beside;  // track id, frames in which both were seen apart

  int ClassId() const;  // with the most votes
  int FramesBeside(int other) const;
};

struct TrackerState {
  double timestamp_s = 0;
  std::vector<BoxTrack> tracks;  // in the order of ids
};

// The compensation used by default: a Kalman filter for each box, detections assigned to boxes by the
// Hungarian method, the camera's rotation taken out, and the evidence for each object gathered over time.
//
// - Assignment in two rounds: detections of a box's class first, then those of another class that overlap
// well:
//   an object keeps its class, by votes.
// - A box that is detected is shown as the detector saw it, another one as it is predicted.
// - Evidence is log-odds: a detection adds logit(score) - logit(neutral_score), a result without the object
//   takes miss_evidence. So a box is held the longer, the longer and the better it was seen. A frame without
//   a result says nothing against an object.
// - An object behind another one is still there: not to see it takes hidden_evidence only. The two must have
//   been seen beside each other, else they may be one object with two boxes.
// - Where boxes overlap, each point that is followed speaks for the box whose motion it fits
// (BoxMotionEstimator): an
//   object behind another one moves on with its own velocity.
// - An object out of view is remembered while its evidence lasts, as the camera may turn back.
class TrackerCompensation : public ReplayingCompensation<TrackerState> {
 public:
  TrackerCompensation(const TrackerCompensationOptions& options, const Camera& camera);

 protected:
  std::vector<Detection> Usable(std::span<const Detection> detections) const override;
  void Advance(const CompensationInput& input, TrackerState* state) override;
  std::vector<CompensatedBox> BoxesOf(const TrackerState& state) const override;

 private:
  void Predict(const CompensationInput& input, TrackerState* state);
  // Gives detections to tracks; returns those that are left.
  std::vector<Detection> Match(const std::vector<Detection>& detections, TrackerState* state) const;
  void Begin(const Detection& detection, TrackerState* state);
  // `all` are the detections of the frame.
  void See(const Detection& detection, const std::vector<Detection>& all, BoxTrack* track) const;
  bool IsOver(const BoxTrack& track) const;
  // log-odds that a detection adds.
  double Evidence(double score) const;
  // Nothing or infinity where they do not belong together.
  double Cost(const BoxTrack& track, const Detection& detection, bool same_class) const;
  // The detection with its sides at the image's border put where the track expects them outside.
  Box Completed(const Box& detected, const Box& predicted) const;
  bool IsHidden(const BoxTrack& track, const std::vector<BoxTrack>& tracks) const;

  TrackerCompensationOptions options_;
  Camera camera_;
  BoxMotionEstimator estimator_;
};

}  // namespace dynamic_slam
