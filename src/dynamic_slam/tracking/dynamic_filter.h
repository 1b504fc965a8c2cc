#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/semantics/dynamic_score.h"
#include "dynamic_slam/semantics/point_motion.h"
#include "dynamic_slam/tracking/box_marks.h"
#include "dynamic_slam/tracking/dynamic_options.h"
#include "dynamic_slam/tracking/keypoint_flow.h"
#include "dynamic_slam/tracking/past_views.h"
#include "dynamic_slam/tracking/witnesses.h"

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

  // Lowers the P(at rest) of an earlier frame's keypoints that are in boxes which nobody knew of then.
  void JudgeLate(std::span<const DynamicBox> boxes, const FeatureSet& features,
                 std::vector<float>* static_probability) const;

  // When the pose is known: which keypoints in and around boxes moved as what is at rest does, and which as
  // the object. Changes frame->static_probability.
  void Watch(const KeypointFlow& flow, const Frame& last, double median_depth, Frame* frame);

  // The same while no pose is known: what is at rest moves as the keypoints outside the boxes do.
  void WatchBeforePose(const KeypointFlow& flow, const Frame& last, Frame* frame);

  // The boxes of the last Judge that are to be watched: of dynamic objects, and of those like a parked car
  // whose class is dynamic and which do not move.
  const std::vector<Box>& Boxes() const { return boxes_; }

  // Whether a point of the frame (ideal px) is in the box of something that moves.
  bool IsHidden(const Eigen::Vector2d& ideal_px) const;

  // Whether the camera stands still and something in the boxes of the last Judge moves.
  bool OnlyBoxesMove(std::span<const PointMotion> motions) const;

  // What a frame adds to the log-odds of a landmark that was matched with a keypoint, and fits the pose or
  // not.
  float Evidence(float static_probability, bool fits) const;

  // Forgets the boxes of earlier frames.
  void Reset();

  bool HasBoxes() const { return !objects_.empty(); }

  const DynamicOptions& options() const { return options_; }

 private:
  // Something whose class is dynamic.
  struct Object {
    DynamicBox box;
    double margin_px = 0;          // by which it may reach out of its box
    uint32_t witnesses = kOfMany;  // WitnessesOf its box
    double moves = 1;              // P(moves) by its class and its motion so far
    double motion_log_odds = 0;    // of moving: what its motion tells beside the class
    ShiftHistory shifts = {};      // while the pose was known

    bool IsMoving() const { return moves >= 0.5; }
  };

  // An object that is in the last frame too, and how it moved in the image.
  struct Mover {
    size_t object;  // in objects_
    Box from, to;
    double ring_px;  // around `to`, where keypoints may be of it
    BoxMotion motion;
  };

  // What the boxes alone say of each keypoint.
  struct ByBoxes {
    std::vector<uint32_t> in_box;  // WitnessesOf the boxes of movers that it is in
    std::vector<float> prior;      // P(at rest)
    std::vector<float> unmoved;    // the same of what nobody asked how it moves
    BoxMarks marks;                // kept for its memory
  };

  // Where a point at rest is in this frame: on the segment, by its depth, ideal px.
  struct RestPlace {
    Eigen::Vector2d far_px, near_px;
    double variance_px2 = 0;  // beside that of the keypoints
  };

  void JudgeByDisplacement(const KeypointFlow& flow, const Frame& last, Frame* frame) const;
  float Combine(float prior, float motion_log_odds) const;
  // P(at rest) of each keypoint, by the boxes and by how it moved.
  void CombineAll(Frame* frame);
  double MarginOf(const Box& box) const;
  void JudgeByBoxes(std::span<const Object> objects, const FeatureSet& features, ByBoxes* result) const;
  // P(at rest) of what is in the boxes of these objects (bits).
  float PriorIn(uint32_t boxes, std::span<const Object* const> objects) const;
  float Prior(double at_rest) const;  // within the bounds of what boxes may say
  void FindMovers(const KeypointFlow& flow);
  // rest: (place in the last frame, ideal px) -> optional<RestPlace>.
  template <class Rest>
  void WatchKeypoints(const Rest& rest, const KeypointFlow& flow, const Frame& last, Frame* frame) const;
  void AskPastViews(const KeypointFlow& flow, double nearest_depth, Frame* frame);
  void WatchObject(const Mover& mover, const Rigid3& frame_from_last, double nearest_depth);

  Camera camera_;
  DynamicOptions options_;
  std::vector<float> octave_scales_;
  std::vector<double> outlines_px_;  // of each octave: how far a corner at an outline reaches beyond it
  std::vector<Object> objects_, last_objects_;
  std::vector<Box> boxes_;  // of objects_
  PastViews past_views_;
  ByBoxes by_boxes_;

  // Kept from frame to frame for their memory.
  std::vector<Mover> movers_;
  std::vector<PastViews::Object> suspects_;
  std::vector<uint32_t> asked_, chosen_;  // keypoints
  BoxMotionEstimator estimator_;
  std::vector<Box> boxes_before_;
  std::vector<Eigen::Vector2d> expected_px_;
};

}  // namespace dynamic_slam
