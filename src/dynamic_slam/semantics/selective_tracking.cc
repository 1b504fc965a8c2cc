#include "dynamic_slam/semantics/selective_tracking.h"

#include <algorithm>
#include <cmath>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

using Displacements = std::span<const std::optional<Eigen::Vector2d>>;

bool IsUsable(const Box& box) {
  return std::isfinite(box.x) && std::isfinite(box.y) && std::isfinite(box.width) &&
         std::isfinite(box.height) && box.width > 0 && box.height > 0;
}

bool IsMatched(const std::optional<Eigen::Vector2d>& displacement) {
  return displacement && displacement->allFinite();
}

// How far a point is outside the box, along the axis where it is farthest; negative inside.
double DistanceOutside(const Box& box, const Eigen::Vector2d& p) {
  return std::max(std::max(box.x - p.x(), p.x() - (box.x + box.width)),
                  std::max(box.y - p.y(), p.y() - (box.y + box.height)));
}

// The whole pixels in [begin, end), within [0, size).
cv::Range PixelRange(double begin, double end, int size) {
  const auto to_pixel = [size](double v) {
    return static_cast<int>(std::ceil(std::clamp(v, 0.0, static_cast<double>(size))));
  };
  return {to_pixel(begin), to_pixel(end)};
}

// Eq. (13) as in line 4 of Algorithm 2. static_points: indices of all matched keypoints in no box.
SelectiveBox CompareWith(const SelectiveOptions& options, const Box& box,
                         std::span<const Eigen::Vector2d> positions_px, Displacements displacements_px,
                         std::span<const size_t> static_points) {
  SelectiveBox result;
  result.ring_px = std::max(options.ring_ratio * std::sqrt(box.Area()), options.min_ring_px);
  if (static_points.size() < static_cast<size_t>(options.min_static_points)) return result;
  for (;; result.ring_px *= 2) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    result.static_points = 0;
    for (const size_t i : static_points) {
      if (DistanceOutside(box, positions_px[i]) > result.ring_px) continue;
      sum += *displacements_px[i];
      ++result.static_points;
    }
    if (result.static_points >= options.min_static_points) {
      result.static_displacement_px = sum / result.static_points;
      return result;
    }
  }
}

// Eq. (12), as the header has it.
KeypointJudgement Judge(const SelectiveOptions& options, const std::optional<Eigen::Vector2d>& displacement,
                        const SelectiveBox& box) {
  if (!IsMatched(displacement) || !box.static_displacement_px) return KeypointJudgement::kUnknown;
  const Eigen::Vector2d& mean = *box.static_displacement_px;
  const double tolerance_px = std::max(options.rho * mean.norm(), options.min_tolerance_px);
  return (*displacement - mean).norm() <= tolerance_px ? KeypointJudgement::kKept
                                                       : KeypointJudgement::kCulled;
}

}  // namespace

cv::Mat DynamicMask(std::span<const Box> boxes, int width, int height) {
  cv::Mat mask = cv::Mat::zeros(height, width, CV_8UC1);
  for (const Box& box : boxes) {
    if (!IsUsable(box)) continue;
    mask(PixelRange(box.y, box.y + box.height, height), PixelRange(box.x, box.x + box.width, width)) = 255;
  }
  return mask;
}

SelectiveResult SelectiveTracking(const SelectiveOptions& options,
                                  std::span<const Eigen::Vector2d> positions_px,
                                  Displacements displacements_px, std::span<const Box> boxes) {
  DS_CHECK(positions_px.size() == displacements_px.size(), "{} positions, {} displacements",
           positions_px.size(), displacements_px.size());
  SelectiveResult result;
  result.keypoints.assign(positions_px.size(), KeypointJudgement::kStatic);

  std::vector<size_t> static_points;
  for (size_t i = 0; i < positions_px.size(); ++i) {
    const Eigen::Vector2d& p = positions_px[i];
    if (!p.allFinite()) {
      result.keypoints[i] = KeypointJudgement::kUnknown;
    } else if (IsMatched(displacements_px[i]) && std::none_of(boxes.begin(), boxes.end(), [&](const Box& b) {
                 return IsUsable(b) && b.Contains(p.x(), p.y());
               })) {
      static_points.push_back(i);
    }
  }
  for (const Box& box : boxes) {
    if (!IsUsable(box)) {
      result.boxes.emplace_back();
      continue;
    }
    const SelectiveBox& compared =
        result.boxes.emplace_back(CompareWith(options, box, positions_px, displacements_px, static_points));
    for (size_t i = 0; i < positions_px.size(); ++i) {
      KeypointJudgement& judgement = result.keypoints[i];
      if (judgement == KeypointJudgement::kCulled ||
          !box.Contains(positions_px[i].x(), positions_px[i].y())) {
        continue;
      }
      judgement = Judge(options, displacements_px[i], compared);
    }
  }
  return result;
}

}  // namespace dynamic_slam
