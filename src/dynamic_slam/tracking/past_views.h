#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/frame.h"
#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// A corner is found where a circle of this radius, in px of its octave, differs from its centre (Rosten and
// Drummond 2006): so near to an outline it is made of the object and of what is behind it, and moves with
// neither.
inline constexpr double kCornerRadius = 3;

// How an object moved in the image from frame to frame, the newest last, px.
class ShiftHistory {
 public:
  void Add(const Eigen::Vector2d& shift_px);
  void Clear() { size_ = 0; }
  // Its motion over the last `steps` frames; nothing when that is not known.
  std::optional<Eigen::Vector2d> Sum(size_t steps) const;

 private:
  std::array<Eigen::Vector2d, 16> shifts_px_;  // a quarter of a second at 60 Hz
  size_t size_ = 0;
};

// What the views of the last quarter of a second say of a frame's keypoints. From one frame to the next a
// person moves by few pixels more than what is at rest, hardly more than the noise of a corner. In a view
// from longer ago the two places at which a keypoint was then, at rest or with the object, are far apart: it
// is looked for at both. No chain of matches is needed, and the unlike places are no rivals.
class PastViews {
 public:
  // Who may have carried a keypoint.
  struct Object {
    Box box;               // in the frame, raw px
    double margin_px = 0;  // by which it may reach out of the box
    const ShiftHistory* shifts = nullptr;
  };

  PastViews(const Camera& camera, std::vector<float> octave_scales)
      : camera_(camera), octave_scales_(std::move(octave_scales)) {}

  // Keeps a frame that has a pose. Where frames are missing since the last one, what was before is forgotten.
  void Add(const Frame& frame);
  void Clear() { count_ = 0; }

  // For each keypoint of the frame, which has a pose, the log-odds of being at rest that one of the views,
  // the three ages in turn, and its neighbours in the image give; 0 where nothing is known. asked: those that
  // are looked for in the view. nearest_depth: nothing at rest is nearer. Valid until the next call.
  std::span<const float> Judge(const Frame& frame, std::span<const uint32_t> asked,
                               std::span<const Object> objects, double nearest_depth);

 private:
  struct View {
    FrameId id;
    double timestamp_s = 0;
    std::vector<Descriptor> descriptors;
    KeypointGrid grid;
    Rigid3 cam_from_world;

    // The least distance of a descriptor within radius_px of the segment; 257 where there is none.
    int Nearest(const Descriptor& descriptor, int octave, const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                double radius_px) const;
  };

  void ForgetUnlessNext(const Frame& frame);
  const View* FromBefore(const Frame& frame, double age_s) const;
  void Ask(const View& view, const Frame& frame, std::span<const uint32_t> asked,
           std::span<const Object> objects, double nearest_depth);
  void ShareWithNeighbours(const Frame& frame);

  Camera camera_;
  std::vector<float> octave_scales_;
  std::vector<View> views_;  // the first count_, the oldest first; the others are kept for their memory
  size_t count_ = 0;

  // Of each keypoint.
  std::vector<float> evidence_, neighbours_sum_;
  std::vector<int> neighbours_;     // that know something
  std::vector<int8_t> looks_;       // in the view: 1 at rest, -1 with an object, 0 neither
  std::vector<uint64_t> carriers_;  // bits: the objects whose boxes it is in
};

}  // namespace dynamic_slam
