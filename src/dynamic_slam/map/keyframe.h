#pragma once

#include <bit>
#include <cstdint>
#include <utility>
#include <vector>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/features/features.h"
#include "dynamic_slam/features/keypoint_grid.h"
#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {

// Another keyframe that sees `weight` of the same landmarks.
struct CovisibleKeyframe {
  KeyframeId id;
  int weight = 0;
};

// An image that stays in the map. Its links to landmarks and other keyframes are made by Map alone.
class Keyframe {
 public:
  Keyframe(KeyframeId id, FrameId frame_id, double timestamp_s, const Rigid3& cam_from_world,
           FeatureSet features, KeypointGrid grid, std::vector<float> static_probability = {},
           PartId part = PartId(0))
      : id_(id),
        frame_id_(frame_id),
        timestamp_s_(timestamp_s),
        cam_from_world_(cam_from_world),
        features_(std::move(features)),
        grid_(std::move(grid)),
        static_probability_(std::move(static_probability)),
        part_(part),
        landmarks_(features_.size()),
        has_landmark_((features_.size() + 63) / 64) {}

  KeyframeId id() const { return id_; }
  FrameId frame_id() const { return frame_id_; }
  PartId part() const { return part_; }  // of the map
  double timestamp_s() const { return timestamp_s_; }

  const Rigid3& cam_from_world() const { return cam_from_world_; }
  void set_cam_from_world(const Rigid3& cam_from_world) { cam_from_world_ = cam_from_world; }
  Eigen::Vector3d CenterInWorld() const { return cam_from_world_.TargetOriginInSource(); }

  // As long now as one unit of length was about here when the keyframe was made: 1, until the scale is
  // corrected.
  double unit() const { return unit_; }
  void Rescale(double factor) { unit_ *= factor; }

  const FeatureSet& features() const { return features_; }
  const Keypoint& keypoint(uint32_t index) const { return features_.keypoints[index]; }
  const KeypointGrid& grid() const { return grid_; }

  // P(at rest) of what a keypoint shows, as Frame has it; 1 where nothing was said.
  float StaticProbability(uint32_t index) const {
    return static_probability_.empty() ? 1.0f : static_probability_[index];
  }

  // The landmark of each keypoint; not valid where there is none.
  const std::vector<LandmarkId>& landmarks() const { return landmarks_; }
  int LandmarkCount() const { return landmark_count_; }

  // Calls visit(keypoint, landmark) for each keypoint that has one; far quicker than a look at all.
  template <class Visitor>
  void ForEachLandmark(Visitor&& visit) const {
    for (uint32_t word = 0; word < has_landmark_.size(); ++word) {
      for (uint64_t bits = has_landmark_[word]; bits != 0; bits &= bits - 1) {
        const uint32_t keypoint = 64 * word + static_cast<uint32_t>(std::countr_zero(bits));
        visit(keypoint, landmarks_[keypoint]);
      }
    }
  }

  const std::vector<float>& static_probability() const { return static_probability_; }
  // When more is known of what moved. What was written into the place index stays.
  void set_static_probability(std::vector<float> probability) {
    static_probability_ = std::move(probability);
  }

  // Keyframes that share landmarks, by id.
  const std::vector<CovisibleKeyframe>& covisible() const { return covisible_; }
  // The landmarks that it shares with another one.
  int WeightOf(KeyframeId other) const;

  // At most `count` keyframes with at least `min_weight` shared landmarks, the most shared first. The second
  // form keeps the buffer of *best.
  std::vector<CovisibleKeyframe> BestCovisible(size_t count, int min_weight = 1) const;
  void BestCovisible(size_t count, int min_weight, std::vector<CovisibleKeyframe>* best) const;

 private:
  friend class Map;
  void ChangeWeight(KeyframeId other, int change);
  // Of a keypoint that has none; not valid: of one that has.
  void SetLandmark(uint32_t keypoint, LandmarkId landmark);

  KeyframeId id_;
  FrameId frame_id_;
  double timestamp_s_;
  Rigid3 cam_from_world_;
  double unit_ = 1;
  FeatureSet features_;
  KeypointGrid grid_;
  std::vector<float> static_probability_;
  PartId part_;
  std::vector<LandmarkId> landmarks_;
  std::vector<uint64_t> has_landmark_;  // a bit for each keypoint
  int landmark_count_ = 0;
  std::vector<CovisibleKeyframe> covisible_;
};

}  // namespace dynamic_slam
