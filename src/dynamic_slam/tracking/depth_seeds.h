#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/features/features.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/map/frame.h"

namespace dynamic_slam {

// Keypoints that show no landmark yet, followed from frame to frame, each with a depth that every frame tells
// better: filters over the inverse depth (Civera et al. 2008; Forster et al., SVO, 2014). Local mapping looks
// for new landmarks along the epipolar lines of keyframes far apart; where movers hide most of the view the
// pose is too uncertain for that, and little is in sight for long enough. From one frame to the next a
// keypoint is found whatever the pose.
class DepthSeeds {
 public:
  DepthSeeds(const Camera& camera, std::vector<float> octave_scales)
      : camera_(camera), octave_scales_(std::move(octave_scales)) {}

  void Clear() { seeds_.clear(); }

  // Lengths of the map are so many times what they were.
  void Scale(double factor);

  // Goes on to the next frame, which has a pose and landmarks, and begins with its keypoints that show none
  // and are likely at rest. frame_from_last: from the camera of the last call. median_depth: of the frame's
  // landmarks.
  void Follow(const Rigid3& frame_from_last, double median_depth, const Frame& frame);

  // The frame of the last Follow became this keyframe of the map. Seeds of known depth that another keyframe
  // saw too become landmarks; returns how many.
  int Plant(KeyframeId keyframe, Map* map);

 private:
  static constexpr uint32_t kNone = 0xffffffffu;

  struct Sighting {
    KeyframeId keyframe;
    uint32_t keypoint;
  };

  // A point at origin + direction / inverse_depth, in the camera of the last frame; the origin is where the
  // camera was that saw it first.
  struct Seed {
    Eigen::Vector3d origin, direction;
    double inverse_depth, variance;  // of the depth along the first camera's axis
    double first_scale;              // of the octave it was first seen in
    Descriptor descriptor;           // where it was seen last, and the octave
    int octave;
    int missed = 0;             // frames since
    uint32_t keypoint = kNone;  // in the last frame
    size_t sightings = 0;
    std::array<Sighting, 4> seen_by;  // the first keyframes that saw it

    bool IsKnown() const;
  };

  // Where the seed is in the frame: along what is likely of its depth.
  struct Hit {
    uint32_t keypoint = kNone;
    int distance = 257;
  };
  Hit Find(const Seed& seed, double nearest_depth, const Frame& frame) const;
  // False when the keypoint does not fit.
  bool Measure(const Keypoint& keypoint, Seed* seed) const;
  void Sow(double median_depth, const Frame& frame);

  Camera camera_;
  std::vector<float> octave_scales_;
  std::vector<Seed> seeds_;

  // Kept between frames for their memory.
  std::vector<Hit> hits_;          // of each seed
  std::vector<uint32_t> seed_of_;  // of each keypoint
};

}  // namespace dynamic_slam
