#pragma once

#include <vector>

#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

// A colour image with its half, quarter, ... sizes, so that it can be sampled at any distance without
// aliasing. It repeats without end in both directions.
class ColorTexture {
 public:
  // `bgr`: CV_8UC3; resized to the next powers of two.
  explicit ColorTexture(const cv::Mat& bgr);

  int width() const { return levels_.front().width; }  // texels
  int height() const { return levels_.front().height; }

  // Blue, green, red and 0 at (u, v), where the image is [0, 1) x [0, 1), v down. `level` 0 is the whole
  // image; linear between texels and between levels.
  cv::v_float32x4 Sample(float u, float v, float level) const;

 private:
  struct Level {
    int width, height;  // powers of two
    std::vector<uint8_t> texels;
  };
  static cv::v_float32x4 SampleLevel(const Level& level, float u, float v);

  std::vector<Level> levels_;
};

}  // namespace dynamic_slam
