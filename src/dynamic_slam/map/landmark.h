#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/features/features.h"
#include "dynamic_slam/geometry/sim3.h"

namespace dynamic_slam {

// Where a keyframe sees a landmark.
struct Observation {
  KeyframeId keyframe;
  uint32_t keypoint = 0;
};

// A point of the static world. Its observations are made by Map alone.
class Landmark {
 public:
  Landmark(LandmarkId id, const Eigen::Vector3d& position, KeyframeId created_by)
      : id_(id), position_(position), created_by_(created_by) {}

  LandmarkId id() const { return id_; }
  const Eigen::Vector3d& position() const { return position_; }  // in world
  void set_position(const Eigen::Vector3d& position) { position_ = position; }

  // Moves it with its surroundings: normal and distances go along.
  void Transform(const Sim3& new_from_old);

  // The keyframe during whose processing the landmark was made: its age.
  KeyframeId created_by() const { return created_by_; }

  const std::vector<Observation>& observations() const { return observations_; }  // by keyframe id
  bool IsSeenBy(KeyframeId keyframe) const;

  // From the observations, by Map::RefreshLandmark.
  const Eigen::Vector3f& normal() const { return normal_; }  // mean direction, from the cameras to the point
  // From max_distance it shows in octave 0, from nearer in coarser octaves, from min_distance in the last.
  float min_distance() const { return min_distance_; }
  float max_distance() const { return max_distance_; }
  // One standard deviation of its place along the normal, in world, if keypoints of octave 0 were off by one
  // focal length: divided by the focal length in px it is for those that are off by one pixel.
  const Eigen::Vector3f& spread() const { return spread_; }
  const Descriptor& descriptor() const { return descriptor_; }  // the observation's nearest to all others

  // How often tracking expected to see it, and found it.
  int visible_count = 1;
  int found_count = 1;
  // Log of P(at rest) / P(moves), from all frames that matched it (tracking/dynamic_filter.h).
  float static_log_odds = 0;

  bool is_from_file = false;  // and not seen to be made in this run

  double FoundRatio() const { return static_cast<double>(found_count) / visible_count; }

 private:
  friend class Map;
  LandmarkId id_;
  Eigen::Vector3d position_;
  KeyframeId created_by_;
  std::vector<Observation> observations_;
  Eigen::Vector3f normal_ = Eigen::Vector3f::Zero();
  float min_distance_ = 0, max_distance_ = 0;
  Eigen::Vector3f spread_ = Eigen::Vector3f::Zero();
  Descriptor descriptor_{};
  bool is_descriptor_stale_ = true;  // observations came or went since it was chosen
};

}  // namespace dynamic_slam
