#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Geometry>

#include "dynamic_slam/base/ids.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/semantics/detection.h"
#include "dynamic_slam/semantics/point_motion.h"

namespace dynamic_slam {

// What is known of a new frame.
struct CompensationInput {
  FrameId frame;
  double timestamp_s = 0;
  // What the detector saw in it, perhaps nothing; none when it gave no result: late, failed, or not asked.
  std::optional<std::vector<Detection>> detections;
  // The camera's rotation since the frame before, x_in_this = cam_from_last * x_in_last; none when unknown.
  std::optional<Eigen::Quaterniond> cam_from_last;
  // How points moved since the frame before, on objects and elsewhere; may be empty. It says more about an
  // object's motion than anything else, and a late result is of little use without it.
  std::vector<PointMotion> motions;
};

// An object that is believed to be in a frame, seen by the detector there or not.
struct CompensatedBox {
  Box box;  // px, inside the image
  int class_id = 0;
  double score = 0;          // trust in it, 0 to 1
  int track_id = 0;          // the same object in other frames; never used again for another one
  bool is_detected = false;  // by the detector in this frame; else predicted from earlier ones
  int age_frames = 0;        // since it was first seen, this frame included
  int missed_frames = 0;     // since the detector last saw it
};

// The boxes of one frame.
struct FrameBoxes {
  FrameId frame;
  std::vector<CompensatedBox> boxes;
};

// Fills in the boxes that a detector misses, from those of earlier frames (section 3.1).
class BoxCompensation {
 public:
  virtual ~BoxCompensation() = default;

  // The boxes in the next frame. Ids of frames grow. Detections that make no sense (not finite, without
  // area, outside the image, scored outside [0, 1]) are dropped.
  virtual std::vector<CompensatedBox> Update(CompensationInput input) = 0;

  // Takes a result that arrives after its frame's Update, and all frames since are computed again. False when
  // the frame is not among the last kHistoryFrames: nothing changes.
  virtual bool UpdateLate(FrameId frame, std::span<const Detection> detections) = 0;

  // The same for the camera's rotation, which tracking knows well only after it used the boxes.
  virtual bool UpdateRotation(FrameId frame, const Eigen::Quaterniond& cam_from_last) = 0;

  // The boxes in the last frame as they are believed to be now, in the order of track ids.
  virtual std::vector<CompensatedBox> Boxes() const = 0;

  // The same of the frames from `first` to the one before the last, as far as they are remembered.
  virtual std::vector<FrameBoxes> EarlierBoxes(FrameId first) const = 0;

  // Forgets all boxes and frames; ids of tracks go on.
  virtual void Reset() = 0;

  static constexpr size_t kHistoryFrames = 60;
};

// The part of the box inside an image, which may have no area.
Box ClipToImage(const Box& box, const Camera& camera);

// The detections that make sense and have at least `min_score`, clipped to the image: the `max_count` best
// ones, best first; of equal ones the first given is the first. One that overlaps a better one of its class
// with an IoU above `max_iou` is a duplicate and dropped.
std::vector<Detection> UsableDetections(std::span<const Detection> detections, const Camera& camera,
                                        double min_score, int max_count, double max_iou);

}  // namespace dynamic_slam
