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

// Which points start inside the box, in order. Without branches: where points are is hard to predict.
void FindPointsIn(const Box& box, std::span<const PointMotion> motions, std::vector<size_t>* result) {
  std::vector<size_t>& inside = *result;
  inside.resize(motions.size());
  const double right = box.x + box.width, bottom = box.y + box.height;
  size_t count = 0;
  for (size_t m = 0; m < motions.size(); ++m) {
    const double x = motions[m].from_px.x(), y = motions[m].from_px.y();
    inside[count] = m;
    count += static_cast<size_t>((x >= box.x) & (y >= box.y) & (x < right) & (y < bottom));
  }
  inside.resize(count);
}

}  // namespace

double Median(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

std::span<const std::optional<BoxMotion>> BoxMotionEstimator::Estimate(
    std::span<const Box> boxes, std::span<const Eigen::Vector2d> expected_px,
    std::span<const PointMotion> motions) {
  estimates_.clear();
  for (size_t i = 0; i < boxes.size(); ++i) {
    CollectPoints(i, boxes, expected_px, motions);
    estimates_.push_back(MotionOf(boxes[i]));
  }
  return estimates_;
}

void BoxMotionEstimator::CollectPoints(size_t box, std::span<const Box> boxes,
                                       std::span<const Eigen::Vector2d> expected_px,
                                       std::span<const PointMotion> motions) {
  points_.clear();
  rivals_.clear();
  for (size_t k = 0; k < boxes.size(); ++k) {
    if (k != box && IntersectionArea(boxes[box], boxes[k]) > 0) rivals_.push_back(k);
  }
  FindPointsIn(Core(boxes[box]), motions, &inside_);
  for (const size_t m : inside_) {
    const PointMotion& motion = motions[m];
    if (!motion.to_px.allFinite()) continue;
    const auto misfit_px = [&](size_t k) { return (motion.to_px - motion.from_px - expected_px[k]).norm(); };
    const bool fits = std::none_of(rivals_.begin(), rivals_.end(), [&](size_t k) {
      return boxes[k].Contains(motion.from_px.x(), motion.from_px.y()) &&
             misfit_px(k) + kMotionNoise_px < misfit_px(box);
    });
    if (fits) points_.push_back(motion);
  }
}

std::optional<BoxMotion> BoxMotionEstimator::MotionOf(const Box& box) {
  if (points_.size() < kMinPoints) return std::nullopt;
  for (std::vector<double>* values : {&dx_, &dy_, &ratios_}) values->clear();
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const PointMotion& motion : points_) {
    dx_.push_back(motion.to_px.x() - motion.from_px.x());
    dy_.push_back(motion.to_px.y() - motion.from_px.y());
    mean += motion.from_px;
  }
  mean /= static_cast<double>(points_.size());
  // Distances between points that are far apart grow with the object. One partner each bounds the time.
  for (size_t i = 0; i < points_.size(); ++i) {
    const PointMotion& a = points_[i];
    const PointMotion& b = points_[(i + points_.size() / 2) % points_.size()];
    const double before = (a.from_px - b.from_px).norm();
    if (before > 0.2 * box.height) ratios_.push_back((a.to_px - b.to_px).norm() / before);
  }
  BoxMotion motion{{Median(&dx_), Median(&dy_)}, 1};
  if (ratios_.size() >= kMinRatios) {
    motion.scale = std::clamp(Median(&ratios_), 1 / kMaxGrowth, kMaxGrowth);
  }
  // The median shift is that of the points' middle, which need not be the box's.
  motion.shift_px += (motion.scale - 1) * (Eigen::Vector2d(box.CenterX(), box.CenterY()) - mean);
  return motion;
}

}  // namespace dynamic_slam
