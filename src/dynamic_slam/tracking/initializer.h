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

// Waits for two frames from which the first map can be made.
class Initializer {
 public:
  Initializer(const Camera& camera, const InitializerOptions& options, std::vector<float> octave_scales);

  // Matches the frame with the reference frame and tries to find the motion between them. When it succeeds the map,
  // which must be empty, gets two keyframes and their landmarks (median depth 1 in the first), and the frame its
  // pose, landmarks and reference. Otherwise reason() says why not.
  bool TryFrame(Frame* frame, Random& random, Map* map);

  const std::string& reason() const { return reason_; }
  void Reset();

 private:
  void StartFrom(const Frame& frame);
  void AddView(const Frame& frame, const std::vector<Match>& matches);
  // The one structure that fits all views; nothing, and the reason, when there is none or more than one.
  std::optional<InitialStructure> ChooseStructure(const TwoViewResult& result);
  void BuildMap(const InitialStructure& structure, const std::vector<Match>& matches, Frame* frame, Map* map);
  double ScaleOf(const Keypoint& keypoint) const { return octave_scales_[static_cast<size_t>(keypoint.octave)]; }
  std::vector<Match> MatchWithReference(const Frame& frame);

  Camera camera_;
  InitializerOptions options_;
  std::vector<float> octave_scales_;
  std::optional<Frame> reference_;
  InitialViews views_;
  std::vector<Eigen::Vector2f> last_places_;  // of the reference's keypoints, px
  std::string reason_;
};

}  // namespace dynamic_slam
