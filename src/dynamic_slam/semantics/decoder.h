#pragma once

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// What networks put out, as detections: boxes in px of the network's input, every class of a box whose score
// reaches the threshold a detection of its own, in the order of the output, without suppression of
// non-maxima. Boxes and scores that are not finite are left out, so that what is returned is finite. All
// throw InputError when an output is not of float numbers or has another shape.

struct DecoderOptions {
  cv::Size input_px;
  int classes = 0;
  int background_column = -1;  // the column, or label, that is no class; those behind it count one less
  double score_threshold = 0.4;
};

// SSD's layer DetectionOutput: N x 7, [image, label, score, left, top, right, bottom], 0 to 1 over the input.
std::vector<Detection> DecodeDetectionOutput(const cv::Mat& output, const DecoderOptions& options);

// A default box of SSD, 0 to 1 over the input.
struct Anchor {
  double center_y = 0, center_x = 0, height = 0, width = 0;
};

// SSD without that layer: boxes, N x 4, [ty, tx, th, tw] relative to N anchors (Liu et al. 2016, Eq. 2), and
// scores, N x (classes and background). The variances are what codes are multiplied with.
struct SsdVariances {
  double center = 0.1, size = 0.2;
};
std::vector<Detection> DecodeSsd(const cv::Mat& boxes, const cv::Mat& scores,
                                 const std::vector<Anchor>& anchors, const SsdVariances& variances,
                                 const DecoderOptions& options);

// Darknet's layers yolo and region as OpenCV gives them: N x (5 + classes), [center x, center y, width,
// height, object, a score for each class], 0 to 1 over the input; the scores hold the object's already.
std::vector<Detection> DecodeRegion(const cv::Mat& output, const DecoderOptions& options);

// YOLOX (Ge et al. 2021): N x (5 + classes), the cells of grids with strides 8, 16 and 32 px, row by row:
// [x, y] in cells from the cell's corner, log of [width, height] in cells, object, scores to multiply with
// it.
std::vector<Detection> DecodeYolox(const cv::Mat& output, const DecoderOptions& options);

}  // namespace dynamic_slam
