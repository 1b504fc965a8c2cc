#include "dynamic_slam/features/image_pyramid.h"

#include <algorithm>

#include <opencv2/core.hpp>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {

ImagePyramid::ImagePyramid(cv::Size size, int levels, double scale_factor) {
  DS_CHECK(levels >= 1 && scale_factor > 1, "levels={} scale_factor={}", levels, scale_factor);
  double scale = 1;
  for (int i = 0; i < levels; ++i, scale *= scale_factor) {
    const cv::Size of_level(std::max(1, cvRound(size.width / scale)),
                            std::max(1, cvRound(size.height / scale)));
    Level level;
    if (i > 0) {
      level.image.create(of_level, CV_8UC1);
      downscalers_.emplace_back(sizes_.back(), of_level);
    }
    level.scale_x = static_cast<float>(size.width) / static_cast<float>(of_level.width);
    level.scale_y = static_cast<float>(size.height) / static_cast<float>(of_level.height);
    levels_.push_back(level);
    sizes_.push_back(of_level);
  }
}

void ImagePyramid::Build(const cv::Mat& grey) {
  DS_CHECK(grey.type() == CV_8UC1 && grey.size() == sizes_.front(), "type={} {}x{}, not {}x{}", grey.type(),
           grey.cols, grey.rows, sizes_.front().width, sizes_.front().height);
  levels_.front().image = grey;
  for (size_t i = 1; i < levels_.size(); ++i)
    downscalers_[i - 1].Run(levels_[i - 1].image, &levels_[i].image);
}

}  // namespace dynamic_slam
