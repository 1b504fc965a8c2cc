#pragma once

#include <string>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/io/image_options.h"
#include "dynamic_slam/semantics/box_mapping.h"

namespace dynamic_slam {

// Makes of a camera's raw images the grey ones that the SLAM works on, the coloured ones that detectors see,
// and of its calibration theirs.
class ImagePreparer {
 public:
  // raw_camera: of the raw images. Throws InputError that names the option when the options do not fit each
  // other, the camera or the mask file, which is read here.
  ImagePreparer(const Camera& raw_camera, const ImageOptions& options);

  // The camera of the prepared images.
  const Camera& camera() const { return camera_; }

  // Where what is at a place of a raw image is in a prepared one.
  BoxMapping box_mapping() const;

  // CV_8UC1 of camera()'s size, not 0 where the mask file forbids keypoints; empty without a mask file.
  const cv::Mat& mask() const { return mask_; }

  // Why the image cannot be prepared, or "". It must have the raw camera's size, 8 or 16 bits, and 1, 3 (BGR)
  // or 4 (BGRA) channels, one with a Bayer pattern.
  std::string Refusal(const cv::Mat& raw) const;

  // *grey becomes CV_8UC1 of camera()'s size and shares no pixels with `raw`; its memory is used again when
  // it has that size already. Throws InputError with the Refusal.
  void Prepare(const cv::Mat& raw, cv::Mat* grey);

  // The same image in colour, CV_8UC3 (BGR), also of a grey one.
  void PrepareColour(const cv::Mat& raw, cv::Mat* colour);

  // mask() together with `mask`, which is empty or like it. Valid until the next call.
  cv::Mat MergedMask(const cv::Mat& mask);

 private:
  void Convert(const cv::Mat& raw, int channels, cv::Mat* prepared);
  cv::Mat ReadMask(const std::string& file) const;

  ImageOptions options_;
  cv::Size raw_size_;
  cv::Rect crop_;  // of the raw image
  Camera camera_;
  cv::Mat mask_;
  int bayer_to_grey_ = -1;  // OpenCV's conversion code for the cropped image; -1: no Bayer pattern
  int bayer_to_colour_ = -1;
  cv::Mat converted_, eight_bits_;  // intermediate images
  cv::Mat merged_mask_;
};

}  // namespace dynamic_slam
