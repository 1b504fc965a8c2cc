#pragma once

#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/tracking/initial_structure.h"
#include "dynamic_slam/tracking/tracker_options.h"

namespace dynamic_slam {

// A frame from which a first map may start, and what was seen of it since.
class ReferenceView {
 public:
  ReferenceView(const Frame& frame, const std::vector<float>& octave_scales);

  // Its keypoints found in the frame. Each is looked for where it was seen last.
  std::vector<Match> MatchWith(const Frame& frame, const InitializerOptions& options);

  // The frame becomes the last of the views.
  void AddView(const Frame& frame, const std::vector<Match>& matches,
               const std::vector<float>& octave_scales);

  const Frame& frame() const { return frame_; }
  Frame* mutable_frame() { return &frame_; }
  const InitialViews& views() const { return views_; }
  // Of any frame with this one, since it was made.
  size_t most_matches() const { return most_matches_; }

 private:
  Frame frame_;
  InitialViews views_;
  std::vector<Eigen::Vector2f> last_places_;  // of the frame's keypoints, px
  size_t most_matches_ = 0;
};

}  // namespace dynamic_slam
