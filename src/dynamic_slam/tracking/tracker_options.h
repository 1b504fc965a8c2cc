#pragma once

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/geometry/pnp.h"
#include "dynamic_slam/geometry/two_view.h"
#include "dynamic_slam/optimize/pose_optimizer.h"

namespace dynamic_slam {

struct InitializerOptions {
  double feature_factor = 5.0;
  int min_matches = 100;
  double min_match_ratio = 0.35;
  double renewal_match_ratio = 0.7;
  int max_references = 3;
  double search_radius_px = 100;
  int max_octave = 3;
  double max_cost_ratio = 0.75;
  double movers_min_parallax_deg = 1.75;
  int movers_min_points = 100;
  TwoViewOptions two_view;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("feature_factor", self.feature_factor,
          OptionField{"", 1, 10, "Times the usual number of keypoints until the map is initialised."});
    visit("min_matches", self.min_matches,
          OptionField{"", 20, 5000, "A reference frame with fewer matches is given up."});
    visit("min_match_ratio", self.min_match_ratio,
          OptionField{
              "", 0, 1,
              "A reference frame is given up below this part of the most matches that it had: those that "
              "are left tell too little of which motion it was."});
    visit("renewal_match_ratio", self.renewal_match_ratio,
          OptionField{"", 0, 1,
                      "Below this part of the most matches of the newest reference frame, the current frame "
                      "becomes another one beside it."});
    visit("max_references", self.max_references,
          OptionField{"", 1, 10, "Reference frames from which a start is tried at a time."});
    visit("search_radius_px", self.search_radius_px,
          OptionField{"px", 5, 1000, "How far from its last place a keypoint is looked for."});
    visit("max_octave", self.max_octave,
          OptionField{"", 0, 11, "Coarser keypoints are too inaccurate to initialise with."});
    visit("max_cost_ratio", self.max_cost_ratio,
          OptionField{"", 0, 1,
                      "Of two motions that fit, the errors of the better over those of the other, at most."});
    visit(
        "movers_min_parallax_deg", self.movers_min_parallax_deg,
        OptionField{"deg", 0, 20,
                    "The parallax of two_view where half of the keypoints or more are on movers, in between "
                    "as far as they are: what is left tells less of which motion it was."});
    visit("movers_min_points", self.movers_min_points,
          OptionField{"", 8, 5000, "The points of two_view there."});
    visit("two_view", self.two_view);
  }
};

struct KeyframePolicyOptions {
  double max_tracked_ratio = 0.9;
  int min_frames = 1;
  int max_frames = 30;
  int min_inliers = 15;
  int max_waiting = 3;
  int max_waiting_when_poor = 5;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit(
        "max_tracked_ratio", self.max_tracked_ratio,
        OptionField{
            "", 0.1, 1,
            "A frame that tracks less than this part of the most since the last keyframe shows new things."});
    visit("min_frames", self.min_frames, OptionField{"", 1, 1000, "Frames between two keyframes at least."});
    visit("max_frames", self.max_frames,
          OptionField{"", 1, 10000, "After so many frames a keyframe is due."});
    visit("min_inliers", self.min_inliers,
          OptionField{"", 4, 1000, "A frame with fewer inliers is too uncertain to become a keyframe."});
    visit("max_waiting", self.max_waiting,
          OptionField{"", 1, 100, "With so many keyframes waiting for local mapping, no more are made."});
    visit("max_waiting_when_poor", self.max_waiting_when_poor,
          OptionField{"", 1, 100, "The same for frames with few inliers, which new landmarks could save."});
  }
};

struct TrackerOptions {
  double motion_radius_px = 15;
  double local_map_radius_px = 4;
  int max_match_distance = 100;
  int min_motion_inliers = 15;
  int min_inliers = 35;
  int movers_min_inliers = 55;
  int min_relocalisation_inliers = 50;
  int local_keyframes = 60;
  int relocalisation_keyframes = 20;
  int restart_after_frames = 2;
  int small_map_keyframes = 5;
  double seeds_min_share = 1;
  bool localise_only = false;
  InitializerOptions initializer;
  KeyframePolicyOptions keyframe;
  PoseOptimizerOptions pose;
  PnpOptions pnp;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("motion_radius_px", self.motion_radius_px,
          OptionField{"px", 1, 200,
                      "Search radius about the place that the motion model predicts, in octave 0."});
    visit("local_map_radius_px", self.local_map_radius_px,
          OptionField{"px", 0.5, 100, "Search radius about a local landmark's projection, in octave 0."});
    visit(
        "max_match_distance", self.max_match_distance,
        OptionField{"bits", 1, 256,
                    "Most that a landmark's descriptor may differ from a keypoint's; within dynamic boxes 60 "
                    "at most."});
    visit("min_motion_inliers", self.min_motion_inliers,
          OptionField{"", 4, 1000, "Inliers that a first guess of the pose needs."});
    visit("min_inliers", self.min_inliers,
          OptionField{"", 4, 1000,
                      "Inliers with less than which the camera is lost; of 1,000 keypoints, and of more in "
                      "proportion."});
    visit(
        "movers_min_inliers", self.movers_min_inliers,
        OptionField{"", 4, 1000,
                    "The same in a view that is full of movers; in between as far as their boxes fill it, as "
                    "what is left is narrow, and more is found by chance."});
    visit("min_relocalisation_inliers", self.min_relocalisation_inliers,
          OptionField{"", 4, 1000, "Inliers that it takes to be found again."});
    visit("local_keyframes", self.local_keyframes,
          OptionField{"", 2, 1000, "Keyframes whose landmarks make the local map."});
    visit("relocalisation_keyframes", self.relocalisation_keyframes,
          OptionField{"", 1, 1000,
                      "Keyframes tried on each frame while lost: three quarters look like it, the others are "
                      "the youngest."});
    visit("restart_after_frames", self.restart_after_frames,
          OptionField{"", 1, 10000,
                      "After so many lost frames a new start is looked for, beside places that are known."});
    visit("small_map_keyframes", self.small_map_keyframes,
          OptionField{"", 0, 1000,
                      "A map of at most so many keyframes is given up then; a larger one is kept."});
    visit("seeds_min_share", self.seeds_min_share,
          OptionField{"", 0, 1,
                      "Where the boxes of movers hold such a part of the keypoints, those of the others that "
                      "show no landmark are followed from frame to frame until their depth is known, and "
                      "become landmarks then: fewer frames are lost, and more errors stay (1: nowhere)."});
    visit("localise_only", self.localise_only,
          OptionField{
              "", 0, 1,
              "Poses in the map that was loaded, and nothing else: the map stays as it is, and no other "
              "is started."});
    visit("initializer", self.initializer);
    visit("keyframe", self.keyframe);
    visit("pose", self.pose);
    visit("pnp", self.pnp);
  }
};

}  // namespace dynamic_slam
