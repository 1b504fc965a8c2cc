#pragma once

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/geometry/sim3_estimation.h"

namespace dynamic_slam {

struct LoopOptions {
  bool enabled = true;
  int max_candidates = 3;
  double min_score_ratio = 0.2;
  int covisible_weight = 15;
  int min_matches = 15;
  int min_inliers = 40;
  double min_found_share = 0.15;
  int min_confirming_keyframes = 2;
  int min_confirming_inliers = 15;
  double min_drift_px = 3;
  int min_keyframes_between = 5;
  int min_edge_weight = 20;
  int pose_graph_iterations = 30;
  bool full_bundle = true;
  Sim3Options sim3 = {};

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("enabled", self.enabled, OptionField{"", 0, 1, "Know places again, and close loops."});
    visit("max_candidates", self.max_candidates,
          OptionField{"", 1, 100, "Places looked at for each keyframe, those that look most like it."});
    visit(
        "min_score_ratio", self.min_score_ratio,
        OptionField{"", 0, 1,
                    "Score of such a place over the best of the keyframes that share landmarks, at least."});
    visit("covisible_weight", self.covisible_weight,
          OptionField{"", 1, 1000, "Keyframes that share so many landmarks are no loop."});
    visit("min_matches", self.min_matches,
          OptionField{"", 4, 1000, "Matches of landmarks by their descriptors that a loop needs."});
    visit("min_inliers", self.min_inliers,
          OptionField{"", 4, 1000, "Landmarks of the old place that must fit the keyframe in the end."});
    visit(
        "min_found_share", self.min_found_share,
        OptionField{"", 0, 1,
                    "These over the landmarks of the old place that the keyframe should see. Ground that "
                    "looks alike everywhere makes less than a tenth, a place seen again a quarter or more."});
    visit("min_confirming_keyframes", self.min_confirming_keyframes,
          OptionField{"", 0, 5, "Neighbours of the keyframe that must see the old place as well."});
    visit("min_confirming_inliers", self.min_confirming_inliers,
          OptionField{"", 1, 1000, "Landmarks of the old place that such a neighbour must see."});
    visit("min_drift_px", self.min_drift_px,
          OptionField{
              "px", 0, 1000,
              "Where the old landmarks show nearer than this to where the map has them (median), they are "
              "linked, and nothing is moved."});
    visit("min_keyframes_between", self.min_keyframes_between,
          OptionField{"", 0, 1000, "Keyframes after a loop in which none is looked for."});
    visit(
        "min_edge_weight", self.min_edge_weight,
        OptionField{"", 1, 1000, "Landmarks that two keyframes share to be held together in a correction."});
    visit("pose_graph_iterations", self.pose_graph_iterations,
          OptionField{"", 1, 1000, "Most steps of a correction."});
    visit("full_bundle", self.full_bundle, OptionField{"", 0, 1, "Adjust the whole map after a correction."});
    visit("sim3", self.sim3);
  }
};

}  // namespace dynamic_slam
