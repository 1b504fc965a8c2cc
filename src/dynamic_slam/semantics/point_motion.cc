#include "dynamic_slam/semantics/point_motion.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace dynamic_slam {
namespace {

constexpr size_t kMinPoints = 6;
constexpr size_t kMinRatios = 10;
constexpr double kSideShare = 0.25;    // left and right of a person a box shows what is behind
constexpr double kMaxGrowth = 1.1;     // from frame to frame
constexpr double kMotionNoise_px = 1;  // of a point

// Left and right of a person a box shows what is behind.
Box Core(const Box& box) {
  return {box.x + kSideShare * box.width, box.y, (1 - 2 * kSideShare) * box.width, box.height};
}

}  // namespace

double Median(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

std::vector<std::vector<PointMotion>> ShareMotions(std::span<const Box> boxes,
                                                   std::span<const Eigen::Vector2d> expected_px,
                                                   std::span<const PointMotion> motions) {
  std::vector<std::vector<PointMotion>> shares(boxes.size());
  std::vector<double> distances_px(boxes.size());
  for (const PointMotion& motion : motions) {
    if (!motion.to_px.allFinite()) continue;
    const Eigen::Vector2d& at = motion.from_px;
    double least_px = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < boxes.size(); ++i) {
      if (!boxes[i].Contains(at.x(), at.y())) continue;
      distances_px[i] = (motion.to_px - at - expected_px[i]).norm();
      least_px = std::min(least_px, distances_px[i]);
    }
    for (size_t i = 0; i < boxes.size(); ++i) {
      if (Core(boxes[i]).Contains(at.x(), at.y()) && distances_px[i] <= least_px + kMotionNoise_px) {
        shares[i].push_back(motion);
      }
    }
  }
  return shares;
}

std::optional<BoxMotion> MotionOfBox(const Box& box, std::span<const PointMotion> inside) {
  if (inside.size() < kMinPoints) return std::nullopt;

  std::vector<double> dx, dy, ratios;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const PointMotion& motion : inside) {
    dx.push_back(motion.to_px.x() - motion.from_px.x());
    dy.push_back(motion.to_px.y() - motion.from_px.y());
    mean += motion.from_px / static_cast<double>(inside.size());
  }
  // Distances between points that are far apart grow with the object. One partner each bounds the time.
  for (size_t i = 0; i < inside.size(); ++i) {
    const PointMotion& a = inside[i];
    const PointMotion& b = inside[(i + inside.size() / 2) % inside.size()];
    const double before = (a.from_px - b.from_px).norm();
    if (before > 0.2 * box.height) ratios.push_back((a.to_px - b.to_px).norm() / before);
  }
  BoxMotion motion{{Median(&dx), Median(&dy)}, 1};
  if (ratios.size() >= kMinRatios) motion.scale = std::clamp(Median(&ratios), 1 / kMaxGrowth, kMaxGrowth);
  // The median shift is that of the points' middle, which need not be the box's.
  motion.shift_px += (motion.scale - 1) * (Eigen::Vector2d(box.CenterX(), box.CenterY()) - mean);
  return motion;
}

}  // namespace dynamic_slam
