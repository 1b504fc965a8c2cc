#pragma once

#include <cstddef>
#include <cstdint>
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

  // The frames chosen so far, in the order of time.
  std::vector<ChosenFrame> Frames() const;

 private:
  // Of a stretch that is over. As JPEG, a sixth of the memory: a run may last for hours.
  struct Packed {
    std::vector<uint8_t> jpeg;
    std::string caption;
  };

  size_t StretchOf(const RunProgress& progress) const;
  static Packed Pack(const ChosenFrame& frame);

  ImagePreparer preparer_;
  size_t stretches_;
  std::vector<Packed> past_;
  ChosenFrame now_;  // of the stretch in hand; without a picture before the first frame
  size_t stretch_ = 0;
  double most_area_px_ = 0;
};

}  // namespace dynamic_slam
