#pragma once

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/optimize/bundle_adjustment.h"

namespace dynamic_slam {

struct MapperOptions {
  int triangulation_neighbours = 10;
  double min_baseline_ratio = 0.05;
  double min_parallax_deg = 1.75;
  int fusion_neighbours = 10;
  int local_keyframes = 30;
  int fixed_keyframes = 40;
  double redundant_ratio = 0.9;
  int interrupting_keyframes = 1;
  bool motion_prior = true;
  // With half the steps the scale drifts among people: that is what a bundle finds last.
  BundleOptions local_bundle{.max_iterations = 10};
  BundleOptions final_bundle{.max_iterations = 20, .refine_iterations = 20, .function_tolerance = 1e-5};

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("triangulation_neighbours", self.triangulation_neighbours,
          OptionField{"", 1, 200, "Neighbours of a new keyframe with which new landmarks are triangulated."});
    visit("min_baseline_ratio", self.min_baseline_ratio,
          OptionField{"", 0, 1,
                      "Distance to such a neighbour over the median depth of the scene, at least: more than "
                      "min_parallax_deg, as else those pass whose error makes their parallax large."});
    visit("min_parallax_deg", self.min_parallax_deg,
          OptionField{
              "deg", 0, 45,
              "Parallax that a new landmark needs; with less its depth is biased, and the scale drifts."});
    visit("fusion_neighbours", self.fusion_neighbours,
          OptionField{"", 1, 200, "Neighbours with which duplicate landmarks are fused."});
    visit("local_keyframes", self.local_keyframes,
          OptionField{"", 1, 500, "Keyframes that local bundle adjustment moves."});
    visit(
        "fixed_keyframes", self.fixed_keyframes,
        OptionField{"", 1, 500,
                    "Keyframes that hold the local ones in place, those that see most of their landmarks."});
    visit(
        "redundant_ratio", self.redundant_ratio,
        OptionField{"", 0.1, 1,
                    "A keyframe is culled when this part of its landmarks is seen as well by three others."});
    visit("interrupting_keyframes", self.interrupting_keyframes,
          OptionField{"", 1, 1000, "Local bundle adjustment ends early when so many keyframes wait."});
    visit(
        "motion_prior", self.motion_prior,
        OptionField{"", 0, 1,
                    "Offline, when the map is adjusted to all frames: what carries a camera has mass, so its "
                    "velocity changes by little from one keyframe to the next. How little, the path itself "
                    "tells."});
    visit("local_bundle", self.local_bundle);
    visit("final_bundle", self.final_bundle);
  }
};

}  // namespace dynamic_slam
