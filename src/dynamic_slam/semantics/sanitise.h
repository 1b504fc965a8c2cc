#pragma once

#include <cstddef>
#include <vector>

#include <opencv2/core/types.hpp>

#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

inline constexpr size_t kMaxDetections = 200;  // of one image

// What of a detector's answer can be relied on, whatever it is: boxes with finite numbers, clipped to the
// image and not empty, of a class that exists, with a score from 0 to 1; the best max_detections of them,
// best first, in an order that depends on nothing but their values.
std::vector<Detection> Sanitise(std::vector<Detection> detections, const cv::Size& image_px, size_t classes,
                                size_t max_detections = kMaxDetections);

// Best score first; equal ones by class, then by position.
void SortByScore(std::vector<Detection>* detections);

// Keeps of boxes of one class that overlap by more than max_iou only the one with the highest score. Looks at
// the 1000 best; the result is sorted as SortByScore does. All numbers must be finite.
std::vector<Detection> SuppressNonMaxima(std::vector<Detection> detections, double max_iou);

}  // namespace dynamic_slam
