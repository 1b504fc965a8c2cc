#pragma once

#include <memory>
#include <span>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/features/features.h"
#include "dynamic_slam/features/orb_options.h"
#include "dynamic_slam/geometry/camera.h"

namespace dynamic_slam {

// scale_factor^octave: the size in full-resolution px of one pixel of each octave.
std::vector<float> OctaveScales(const OrbOptions& options);

// ORB features (Rublee et al. 2011), evenly spread over the image and the pyramid. Keeps its buffers between
// calls: not for use by two threads at once. Has threads of its own where OrbOptions::threads is above 1; 0
// is 1 here.
class OrbExtractor {
 public:
  OrbExtractor(const OrbOptions& options, const Camera& camera);
  ~OrbExtractor();

  // grey: CV_8UC1 of the camera's size. mask: empty, or CV_8UC1 of the same size; a keypoint is dropped where
  // it is not 0 (Eq. 11: 1 is dynamic), and where the camera cannot see (Camera::CanSee). Replaces the
  // content of *features.
  void Extract(const cv::Mat& grey, const cv::Mat& mask, FeatureSet* features);

  // Wanted keypoints per image from now on; used to extract more until the map is initialised.
  void SetFeatures(int features);

  // FAST contrast that every corner has at least, from now on.
  void SetMinThreshold(int grey_levels);

  // Parts of the image, px, whose keypoints count less from now on: before the first of them is taken, every
  // cell outside has given several. Nothing: all count alike.
  void Defer(std::span<const cv::Rect> areas);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dynamic_slam
