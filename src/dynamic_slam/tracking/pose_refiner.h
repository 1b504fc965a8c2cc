#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "dynamic_slam/base/file_backed_vector.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/tracking/backfiller.h"
#include "dynamic_slam/tracking/frame_finder.h"

namespace dynamic_slam {

// Tracks frames once more when the map is finished: landmarks lie better then than when the frames' turn
// came, and more are known. They are kept in a file.
class PoseRefiner {
 public:
  enum class ViewsOf {
    kBetweenKeyframes,  // every third frame there
    kAll
  };

  PoseRefiner(const Camera& camera, const TrackerOptions& options, SharedMap* map);

  // Keeps the keypoints of a frame that may be at rest. min_inliers: that a pose of it needs. Of a run with
  // more than eight million of them, hours, the later frames are left out (512 MB).
  void Keep(const Frame& frame, int min_inliers);

  // The poses that are found for those frames that have one in `known`, each in the part of the map where
  // that is: from the frames before or else from the pose that is known, and where that leaves doubt from the
  // frames after. `should_stop` may be empty; when it says so, that is all. views: gets, if not null, what
  // those frames see of the map.
  std::vector<AnchoredPose> Refine(std::span<const AnchoredPose> known,
                                   const std::function<bool()>& should_stop,
                                   std::vector<FrameView>* views = nullptr,
                                   ViewsOf of = ViewsOf::kBetweenKeyframes);

  // Of frames that have a pose in `known`, and none in `found`, what Refine returned: the stamps of those in
  // a row to most of which the camera cannot have come from the ones that were found.
  std::set<double> Refuted(std::span<const AnchoredPose> known, std::span<const AnchoredPose> found) const;

  // The backfiller keeps the frames of these stamps too, as if they had no pose.
  void GiveTo(Backfiller* backfiller, const std::set<double>& stamps) const;

  void Clear();

 private:
  struct KeptKeypoint {
    Keypoint keypoint;
    float static_probability;
    Descriptor descriptor;
  };
  struct KeptFrame {
    FrameId id;
    double timestamp_s;
    size_t first, count;  // of its keypoints
    int min_inliers;
  };

  struct Refined {
    std::optional<AnchoredPose> pose;
    double right_inliers = 0;
    bool has_view = false;  // is asked for it
    FrameView view;
  };

  void AskForViews(ViewsOf of, std::vector<Refined>* refined) const;
  // In the order of time or against it: tracks the frames that are in doubt from those that it came by,
  // and those that are known and not kept.
  void Pass(bool is_forward, const KnownPoses& known, const std::function<bool()>& should_stop,
            std::vector<Refined>* refined);
  void Track(const KeptFrame& kept, std::span<const KnownPoses::Guess> guesses, const KnownPoses& others,
             Refined* refined);
  Frame Restore(const KeptFrame& kept) const;

  SharedMap* map_;
  FrameFinder finder_;
  FileBackedVector<KeptFrame> frames_;  // in the order of time
  FileBackedVector<KeptKeypoint> keypoints_;
};

}  // namespace dynamic_slam
