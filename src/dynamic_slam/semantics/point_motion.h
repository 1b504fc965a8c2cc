#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// Where a point of the image before is in this one, px.
struct PointMotion {
  Eigen::Vector2d from_px, to_px;
};

// How a box moved: its centre by shift_px, its sides by the factor `scale`.
struct BoxMotion {
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  double scale = 1;
};

// The value in the middle; not empty, and their order is lost.
double Median(std::vector<double>* values);

// How boxes moved, each by the points in its middle. Keeps its buffers from call to call.
class BoxMotionEstimator {
 public:
  // For each box the motion of the object that fills most of it: medians, which bear that almost half of the
  // points belong to something else; nothing when there are too few. A point in the middle of several boxes
  // speaks for those whose expected shift (px) it fits: so boxes of objects that cross keep each its own
  // motion, and none follows the points in front of it. Valid until the next call.
  std::span<const std::optional<BoxMotion>> Estimate(std::span<const Box> boxes,
                                                     std::span<const Eigen::Vector2d> expected_px,
                                                     std::span<const PointMotion> motions);

 private:
  void CollectPoints(size_t box, std::span<const Box> boxes, std::span<const Eigen::Vector2d> expected_px,
                     std::span<const PointMotion> motions);
  std::optional<BoxMotion> MotionOf(const Box& box);

  std::vector<std::optional<BoxMotion>> estimates_;
  std::vector<size_t> inside_, rivals_;
  std::vector<PointMotion> points_;  // of the box in hand
  std::vector<double> dx_, dy_, ratios_;
};

}  // namespace dynamic_slam
