#include "dynamic_slam/features/downscaler.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

cv::Mat Noise(cv::Size size) {
  cv::Mat image(size, CV_8UC1);
  cv::RNG random(7);
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

TEST(DownscalerTest, GivesTheBytesOfOpenCv) {
  const cv::Size sizes[][2] = {{{640, 480}, {533, 400}},   {{533, 400}, {444, 333}}, {{752, 480}, {627, 400}},
                               {{1241, 376}, {1034, 313}}, {{640, 480}, {320, 240}}, {{641, 479}, {213, 160}},
                               {{100, 50}, {100, 50}},     {{17, 9}, {16, 8}},       {{5, 5}, {1, 1}}};
  for (const auto& [from, to] : sizes) {
    const cv::Mat image = Noise(from);
    cv::Mat expected, scaled(to, CV_8UC1);
    cv::resize(image, expected, to, 0, 0, cv::INTER_LINEAR);
    Downscaler downscaler(from, to);
    downscaler.Run(image, &scaled);
    cv::Mat difference;
    cv::absdiff(scaled, expected, difference);
    // Half the size is a case of its own in OpenCV, a mean of four that rounds once.
    const bool is_half = 2 * to.width == from.width && 2 * to.height == from.height;
    EXPECT_LE(cv::norm(difference, cv::NORM_INF), is_half ? 1 : 0) << from << " " << to;
  }
}

TEST(DownscalerTest, PartsOfLargerImages) {
  const cv::Mat large = Noise({200, 100});
  const cv::Mat part = large(cv::Rect(30, 20, 120, 60));
  cv::Mat scaled(50, 100, CV_8UC1), of_copy(50, 100, CV_8UC1);
  Downscaler downscaler({120, 60}, {100, 50});
  downscaler.Run(part, &scaled);
  downscaler.Run(part.clone(), &of_copy);
  EXPECT_EQ(cv::norm(scaled, of_copy, cv::NORM_INF), 0);
}

TEST(DownscalerTest, RefusesOtherSizes) {
  Downscaler downscaler({100, 100}, {50, 50});
  cv::Mat out(50, 50, CV_8UC1);
  EXPECT_THROW(downscaler.Run(Noise({99, 100}), &out), InternalError);
  EXPECT_THROW(Downscaler({10, 10}, {11, 10}), InternalError);
}

}  // namespace
}  // namespace dynamic_slam
