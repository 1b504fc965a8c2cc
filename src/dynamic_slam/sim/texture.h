#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {

// A seed for one part of a scene, so that a change of one part leaves the others as they are.
inline uint64_t SubSeed(uint64_t seed, uint64_t part) {
  return Random(Random(seed).Next() ^ (part * 0xd1342543de82ef95ULL)).Next();
}

// A grey image with its half, quarter, ... sizes, so that it can be sampled at any distance without aliasing.
class Texture {
 public:
  // `image`: CV_8UC1. Halved as long as both sides are even.
  explicit Texture(const cv::Mat& image);

  int width() const { return levels_.front().cols; }   // texels
  int height() const { return levels_.front().rows; }  // texels
  const cv::Mat& image() const { return levels_.front(); }

  // Grey value at (x, y) in texels of the whole image, whose corners are (0, 0) and (width, height): so texel
  // (i, j) is centred at (i + 0.5, j + 0.5). Linear between texels and between levels; level 0 is the whole
  // image.
  float Sample(float x, float y, float level) const;

 private:
  float SampleLevel(float x, float y, int level) const;

  std::vector<cv::Mat> levels_;
};

// A rich surface without repetition: noise at all scales, patches of all sizes, posters with writing.
// `texels_per_m` says how large the sizes are that are given in metres. Sides are rounded up to multiples
// of 64.
cv::Mat MakeRichTexture(uint64_t seed, double width_m, double height_m, double texels_per_m);

}  // namespace dynamic_slam
