#pragma once

#include <map>
#include <span>
#include <utility>
#include <vector>

#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/map/shared_map.h"

namespace dynamic_slam {

// Poses of frames by their stamps, and how the camera moves as far as they tell.
class KnownPoses {
 public:
  using ByStamp = std::map<double, AnchoredPose>;

  // Where a frame may be, and a keyframe near there.
  struct Guess {
    KeyframeId keyframe;
    Rigid3 cam_from_world;
  };

  // About a guess a frame is looked for in what the motion model looks through, and, as it is only a guess,
  // in three times as much.
  static constexpr double kSearches[] = {1.0, 3.0};

  explicit KnownPoses(const SharedMap* map) : map_(map) {}
  // Learns from the poses how fast the camera was, and how often there are frames.
  KnownPoses(std::span<const AnchoredPose> poses, const SharedMap* map);

  const ByStamp& by_stamp() const { return by_stamp_; }
  bool Contains(double timestamp_s) const { return by_stamp_.contains(timestamp_s); }
  // Nothing is learnt from this one.
  void Add(const AnchoredPose& pose) { by_stamp_.emplace(pose.timestamp_s, pose); }
  // What was learnt from it stays.
  void Forget(double timestamp_s) { by_stamp_.erase(timestamp_s); }
  // Those in one part of the map that are not outside these stamps, and what was learnt from all.
  KnownPoses Within(PartId part, double first_s, double last_s) const;

  // Median time from pose to pose; 0: nobody knows which frames are in a row.
  double interval_s() const { return interval_s_; }
  // From poses farther away nobody knows where the camera is.
  double max_gap_s() const { return max_gap_s_; }

  // Stamps of the poses before and after.
  std::pair<double, double> Between(double timestamp_s) const;
  // No farther away than max_gap_s, or null.
  const AnchoredPose* Nearest(double timestamp_s) const;
  // The best first: from the poses before and after, no farther away than max_gap_s.
  std::vector<Guess> Guesses(double timestamp_s) const;

  bool AreInOnePart(const AnchoredPose& a, const AnchoredPose& b) const;
  // Whether the camera can have come from one to the other, as far as is known.
  bool IsReachable(const AnchoredPose& a, const AnchoredPose& b) const;
  // The same from the pose before, and to the pose after.
  bool IsPlausible(const AnchoredPose& pose) const;

 private:
  void LearnMotion();
  // Adds where the camera is at the stamp if it went on as between the two poses, and where it was at the
  // nearer.
  void Extrapolate(const AnchoredPose& nearer, const AnchoredPose* farther, double timestamp_s,
                   const Map& map, std::vector<Guess>* guesses) const;

  const SharedMap* map_;
  ByStamp by_stamp_;
  double interval_s_ = 0, max_gap_s_ = 0;
  std::map<PartId, double> max_speed_;  // map units per s
};

}  // namespace dynamic_slam
