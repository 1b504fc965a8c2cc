#pragma once

#include <algorithm>
#include <vector>

#include "dynamic_slam/base/ids.h"

namespace dynamic_slam {

// A rectangle along the axes of the image, px of the raw (distorted) image as tracking sees it.
struct Box {
  double x = 0, y = 0;  // top left corner
  double width = 0, height = 0;

  double Area() const { return std::max(width, 0.0) * std::max(height, 0.0); }
  double CenterX() const { return x + 0.5 * width; }
  double CenterY() const { return y + 0.5 * height; }
  // Of a point at most margin_px outside as well. Without branches: where points are is hard to predict.
  bool Contains(double px, double py, double margin_px = 0) const {
    return (px >= x - margin_px) & (py >= y - margin_px) & (px < x + width + margin_px) &
           (py < y + height + margin_px);
  }
};

inline double IntersectionArea(const Box& a, const Box& b) {
  const double width = std::min(a.x + a.width, b.x + b.width) - std::max(a.x, b.x);
  const double height = std::min(a.y + a.height, b.y + b.height) - std::max(a.y, b.y);
  return width > 0 && height > 0 ? width * height : 0;
}

// Intersection over union, 0 for boxes without area.
inline double IoU(const Box& a, const Box& b) {
  const double intersection = IntersectionArea(a, b);
  return intersection > 0 ? intersection / (a.Area() + b.Area() - intersection) : 0;
}

// An object that a detector saw.
struct Detection {
  Box box;
  int class_id = 0;  // index into the class names of the detector that saw it
  double score = 0;  // trust in it, 0 to 1
};

// All that was seen in one image. An image without objects is a result too; a detector that failed gives
// none.
struct DetectionSet {
  FrameId frame;
  double timestamp_s = 0;
  std::vector<Detection> detections;
};

}  // namespace dynamic_slam
