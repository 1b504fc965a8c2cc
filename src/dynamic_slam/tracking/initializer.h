#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/two_view.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/tracking/initial_structure.h"
#include "dynamic_slam/tracking/reference_view.h"
#include "dynamic_slam/tracking/shutter_correction.h"
#include "dynamic_slam/tracking/tracker_options.h"

namespace dynamic_slam {

// Two views of which a first map can be made.
struct InitialProposal {
  InitialStructure structure;
  std::vector<Match> matches;  // keypoints of the reference view and of the last one
  // One motion is clearly better than any other. When it is not, a map of the better one is worth a try, but
  // can turn out wrong: go on asking.
  bool is_certain = false;
  size_t reference = 0;  // which of the Initializer's
};

// Waits for frames from which the first map can be made: two far enough apart, and one between at least.
class Initializer {
 public:
  Initializer(const Camera& camera, const InitializerOptions& options, std::vector<float> octave_scales);

  // Matches the frame with the reference frames and tries to find the motion between them and the structure.
  // Nothing while that is not possible: reason() says why.
  // untold_from: of FrameObjects; a start is made only from a frame before it.
  std::optional<InitialProposal> Propose(const Frame& frame, Random& random, FrameId untold_from = {});

  // Calls fn(Frame*) for each frame with which others are matched. What it gives P(at rest) 0 is not used any
  // more.
  template <class Fn>
  void ForEachReference(Fn&& fn) {
    for (ReferenceView& reference : references_) fn(reference.mutable_frame());
  }

  // Gives the map a new part of two keyframes and their landmarks (median depth 1 in the first), and the
  // frame, which is the one of the proposal, its pose, landmarks and reference.
  // The frames before it that have a pose now, in the order of time.
  std::vector<AnchoredPose> BuildMap(const InitialProposal& proposal, Frame* frame, Map* map);

  // The oldest frame with which all are matched, after BuildMap the one of the map; not valid before the
  // first.
  FrameId reference() const { return references_.empty() ? FrameId() : references_.front().frame().id; }

  const std::string& reason() const { return reason_; }
  void Reset();

 private:
  std::vector<std::vector<Match>> MatchReferences(const Frame& frame);
  void AddReferenceIfDue(const Frame& frame);
  std::optional<InitialProposal> ProposeFrom(size_t index, const Frame& frame, std::vector<Match> matches,
                                             Random& random);
  // What a start needs in view of what the frame shows.
  TwoViewOptions Limits(const Frame& frame) const;
  // The structure that fits all views best; nothing, and the reason, when there is none or another fits as
  // well.
  std::optional<InitialProposal> ChooseStructure(const TwoViewResult& result, const InitialViews& views,
                                                 int min_points);
  void MoveKeypoints(const InitialProposal& proposal, double scale, Frame* reference, Frame* last) const;

  Camera camera_;
  InitializerOptions options_;
  std::vector<float> octave_scales_;
  ShutterCorrection shutter_;
  std::vector<ReferenceView> references_;  // the oldest first
  bool is_reviewing_ = false;              // of a map that was made already
  std::string reason_;
};

}  // namespace dynamic_slam
