#pragma once

#include <array>
#include <string>
#include <string_view>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/semantics/selective_tracking.h"

namespace dynamic_slam {

// What tracking and mapping make of the boxes of dynamic objects.
struct DynamicOptions {
  // none: nothing. boxes: no keypoint in a box is used. paper: Eq. (12), Algorithm 2. weights: the default.
  static constexpr std::array<std::string_view, 4> kMethods = {"none", "boxes", "paper", "weights"};

  std::string method = "weights";
  double object_share = 0.8;
  double margin_ratio = 0.02;
  double missed_object = 0.05;
  bool motion = true;
  bool past_views = true;
  bool landmark_odds = true;
  bool more_features = true;
  bool shield_hidden = true;
  double max_feature_factor = 4.0;
  SelectiveOptions selective;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("method", self.method,
          OptionField{
              "", 0, 0,
              "What is made of the keypoints in dynamic boxes: all used, none, those that move like the "
              "static ones around (Algorithm 2), or each weighed by how likely it is at rest.",
              kMethods});
    visit("object_share", self.object_share,
          OptionField{"", 0, 1, "Of the keypoints in a box, the part that belongs to the object (weights)."});
    visit("margin_ratio", self.margin_ratio,
          OptionField{"", 0, 1, "By how much of its side an object may reach out of its box (weights)."});
    visit("missed_object", self.missed_object,
          OptionField{"", 0.001, 0.5, "P(moves) of a keypoint in no box (weights)."});
    visit("motion", self.motion,
          OptionField{"", 0, 1, "Keypoints in and around boxes are judged by how they move (weights)."});
    visit("past_views", self.past_views,
          OptionField{"", 0, 1,
                      "They are looked for in views of the last quarter of a second too, where an object has "
                      "moved far enough to be told from what is behind it (weights, with motion)."});
    visit("landmark_odds", self.landmark_odds,
          OptionField{"", 0, 1, "Landmarks gather evidence for being at rest over frames (weights)."});
    visit("more_features", self.more_features,
          OptionField{"", 0, 1,
                      "Extract more keypoints when dynamic boxes take many of them; while no pose is "
                      "known, those beside the boxes first."});
    visit("max_feature_factor", self.max_feature_factor,
          OptionField{"", 1, 10, "Times the usual number of keypoints that this may be at most."});
    visit("shield_hidden", self.shield_hidden,
          OptionField{"", 0, 1, "Landmarks behind a dynamic box are not counted as not found."});
    visit("selective", self.selective);
  }
};

}  // namespace dynamic_slam
