#pragma once

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/io/image_preparer.h"
#include "dynamic_slam/system/sequence_runner.h"

namespace dynamic_slam {

// A frame as tracking saw it (frame_picture.h), CV_8UC3.
struct ChosenFrame {
  cv::Mat picture;
  std::string caption;
};

// Chooses a few frames of a run that show what happened: of each stretch of it, one in which dynamic objects
// take most of the image.
class FrameChoice {
 public:
  // stretches: as many frames, where the source knows how many images it has.
  FrameChoice(const Camera& raw_camera, const ImageOptions& options, int stretches);

  // To be called after each frame.
  void Watch(const RunProgress& progress);

  std::vector<ChosenFrame>& frames() { return frames_; }

 private:
  size_t StretchOf(const RunProgress& progress) const;

  ImagePreparer preparer_;
  size_t stretches_;
  std::vector<ChosenFrame> frames_;
  size_t stretch_ = 0;
  double most_area_px_ = 0;
};

}  // namespace dynamic_slam
