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

// The points in the middle of each box. One in the middle of several goes to those whose expected shift (px)
// it fits: so boxes of objects that cross keep each its own motion, and none follows the points in front of
// it.
std::vector<std::vector<PointMotion>> ShareMotions(std::span<const Box> boxes,
                                                   std::span<const Eigen::Vector2d> expected_px,
                                                   std::span<const PointMotion> motions);

// The motion of the object that fills most of the box, from the points in its middle: medians, which bear
// that almost half of them belong to something else. Nothing when there are too few points.
std::optional<BoxMotion> MotionOfBox(const Box& box, std::span<const PointMotion> inside);

}  // namespace dynamic_slam
