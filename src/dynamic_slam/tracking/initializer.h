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
#include "dynamic_slam/tracking/tracker_options.h"

namespace dynamic_slam {

// Two views of which a first map can be made.
struct InitialProposal {
  InitialStructure structure;
  std::vector<Match> matches;  // keypoints of the reference view and of the last one
  // One motion is clearly better than any other. When it is not, a map of the better one is worth a try, but
  // can turn out wrong: go on asking.
  bool is_certain = false;
};

// Waits for frames from which the first map can be made: two far enough apart, and one between at least.
class Initializer {
 public:
  Initializer(const Camera& camera, const InitializerOptions& options, std::vector<float> octave_scales);

  // Matches the frame with the reference frame and tries to find the motion between them and the structure.
  // Nothing while that is not possible: reason() says why.
  std::optional<InitialProposal> Propose(const Frame& frame, Random& random);

  // Gives the map a new part of two keyframes and their landmarks (median depth 1 in the first), and the
  // frame, which is the one of the proposal, its pose, landmarks and reference.
  // The frames before it that have a pose now, in the order of time.
  std::vector<AnchoredPose> BuildMap(const InitialProposal& proposal, Frame* frame, Map* map);

  // The frame with which all are matched; not valid before the first.
  FrameId reference() const { return reference_.has_value() ? reference_->id : FrameId(); }

  const std::string& reason() const { return reason_; }
  void Reset();

 private:
  void StartFrom(const Frame& frame);
  // What a start needs in view of what the frame shows.
  TwoViewOptions Limits(const Frame& frame) const;
  void AddView(const Frame& frame, const std::vector<Match>& matches);
  // The structure that fits all views best; nothing, and the reason, when there is none or another fits as
  // well.
  std::optional<InitialProposal> ChooseStructure(const TwoViewResult& result, int min_points);
  double ScaleOf(const Keypoint& keypoint) const {
    return octave_scales_[static_cast<size_t>(keypoint.octave)];
  }
  std::vector<Match> MatchWithReference(const Frame& frame);

  Camera camera_;
  InitializerOptions options_;
  std::vector<float> octave_scales_;
  std::optional<Frame> reference_;
  InitialViews views_;
  size_t most_matches_ = 0;                   // of any frame with the reference
  std::vector<Eigen::Vector2f> last_places_;  // of the reference's keypoints, px
  std::string reason_;
};

}  // namespace dynamic_slam
