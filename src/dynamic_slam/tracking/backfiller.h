#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/tracking/frame_finder.h"
#include "dynamic_slam/tracking/known_poses.h"

namespace dynamic_slam {

// Gives frames that had no pose when their turn came one in the whole map, which knows more: from where the
// frames before and after them are, or else, where two in a row agree, from what they look like. A pose needs
// as many inliers as it did then, so near that they are no chance, and must be one to which the camera can
// have moved from those before and after it. Where frames show what the map does not have, it can grow by
// them, also against the order of time.
class Backfiller {
 public:
  Backfiller(const Camera& camera, const TrackerOptions& options, uint64_t seed, SharedMap* map);

  // Keeps what is needed of a frame, unless it is kept already. has_pose: it has one, but may lose it yet.
  // The oldest frames are forgotten when all together have more than two million keypoints (130 MB).
  void Keep(const Frame& frame, int min_inliers, bool has_pose);

  // No frame will lose its pose any more: those that have one are forgotten.
  void ForgetPosed();
  // They have none any more.
  void PartWasErased();
  // The last so many of them have none any more.
  void LastWereWithdrawn(int count);

  // The poses of frames kept, in the order in which they were found. known: of all frames that have one, in a
  // part of the map that is there. `should_stop` may be empty; when it says so, that is all.
  std::vector<AnchoredPose> Find(std::span<const AnchoredPose> known,
                                 const std::function<bool()>& should_stop);

  // Whether there are frames in a row with many that Find does not find. Grow is about those.
  bool PlanGrowth(std::span<const AnchoredPose> known, const std::function<bool()>& should_stop);

  // The same as Find for frames of the last plan: those of them become keyframes that would have done so in
  // tracking. map_keyframe: what local mapping does with one that is in the map, its landmarks linked.
  using MapKeyframe = std::function<void(KeyframeId)>;
  std::vector<AnchoredPose> Grow(std::span<const AnchoredPose> known, const MapKeyframe& map_keyframe,
                                 const std::function<bool()>& should_stop);

  // Frames are looked for in all parts of the map but this one, in which no pose may be known; in all, if it
  // is not valid.
  void Ignore(PartId part) { finder_.localiser().Ignore(part); }

  // Of the frames that are kept.
  std::set<double> Stamps() const;
  // Others are forgotten.
  void KeepOnly(const std::set<double>& stamps);

  void Clear();

 private:
  struct KeptFrame {
    FrameId id;
    double timestamp_s = 0;
    FeatureSet features;
    std::vector<float> static_probability;
    int min_inliers = 0;
    bool has_pose = false;
    std::optional<std::pair<double, double>> tried_between;  // stamps of the poses before and after it, s
    bool is_left_out = false;                                // when the map grows
  };
  // Frames in a row, forwards or backwards, by which the map grows: numbers of frames, and the most inliers
  // from the keyframe on.
  struct Chain {
    int64_t keyframe = -2, last = -2;
    int most_inliers = 0;
  };

  // These add to known and found; false: they were told to stop. From the poses that are known, from
  // neighbour to neighbour.
  bool Spread(const std::function<bool()>& should_stop, KnownPoses* known, std::vector<AnchoredPose>* found);
  // Far from any: by what frames look like, each for itself. A pose that the next frame does not confirm was
  // found by chance, or on somebody who was there before.
  bool Recognise(const std::function<bool()>& should_stop, KnownPoses* known,
                 std::vector<AnchoredPose>* found);
  std::optional<AnchoredPose> FindFromNeighbours(const KnownPoses& known, KeptFrame* kept);
  // Frames in a row of which no more are missing in these than are bridged anyhow: the map has what they
  // show. Whether others are left.
  bool LeaveOut(std::span<const AnchoredPose> known, const std::vector<AnchoredPose>& found);
  bool IsLeftOut(const KeptFrame& kept) const { return map_keyframe_ && kept.is_left_out; }
  template <class Predicate>
  void Forget(Predicate&& is_forgotten);
  Frame FrameOf(const KeptFrame& kept);
  // Makes the frame a keyframe where that is due; its pose hangs on that then.
  void GrowBy(const Frame& frame, int inliers, AnchoredPose* pose);

  TrackerOptions options_;
  SharedMap* map_;
  FrameFinder finder_;
  uint64_t seed_;
  std::deque<KeptFrame> kept_;  // in the order of time
  size_t keypoints_ = 0;        // of all of them
  MapKeyframe map_keyframe_;    // empty: the map stays as it is
  Chain chain_;
};

}  // namespace dynamic_slam
