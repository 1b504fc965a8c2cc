#pragma once

#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/io/frame_source.h"

namespace dynamic_slam {

// What can be measured in a clip before any SLAM runs on it. Medians over images.
struct ClipMeasures {
  size_t images = 0;          // that were looked at
  double grey = 0;            // 0 to 255
  double dark_share = 0;      // of pixels that are black
  double bright_share = 0;    // of pixels that are white
  double edge_width_px = 0;   // over which a strong edge goes from dark to bright; 0: no strong edges
  double keypoints = 0;       // of kWantedKeypoints
  double motion_share = 0;    // how far points move in a third of a second, as a share of the image's width
  size_t pairs = 0;           // of images with matches, apart by a twentieth of the image's width
  double rotation_share = 0;  // of what fits any motion in these, what fits a mere rotation

  static constexpr int kWantedKeypoints = 1000;
};

// The width of strong edges in an image (CV_8UC1), px; 0 where there are too few.
double EdgeWidth(const cv::Mat& grey);

// camera: of the source; without one, its focal length is taken to be its width, and nothing is said about
// it.
ClipMeasures MeasureClip(const std::optional<Camera>& camera, FrameSource* source);

}  // namespace dynamic_slam
