#include "dynamic_slam/semantics/image_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;

// Blurred noise, of which a window is seen.
cv::Mat Texture() {
  Random random(7);
  cv::Mat noise(600, 800, CV_8UC1);
  for (int y = 0; y < noise.rows; ++y) {
    for (int x = 0; x < noise.cols; ++x) noise.at<uchar>(y, x) = static_cast<uchar>(random.Index(256));
  }
  cv::GaussianBlur(noise, noise, {}, 3);
  cv::normalize(noise, noise, 0, 255, cv::NORM_MINMAX);
  return noise;
}

TEST(ImageMotion, FollowsAShiftedImage) {
  const cv::Mat texture = Texture();
  ImageMotion motion;
  EXPECT_THAT(motion.Update(texture({40, 40, 640, 480})), IsEmpty());
  const auto motions = motion.Update(texture({28, 46, 640, 480}));
  ASSERT_GT(motions.size(), 200u);
  size_t right = 0;
  for (const PointMotion& m : motions) {
    if ((m.to_px - m.from_px - Eigen::Vector2d(12, -6)).norm() < 0.3) ++right;
  }
  EXPECT_GT(right, motions.size() * 9 / 10);
}

TEST(ImageMotion, StartsAgainWithAnotherSizeAndBearsAnEmptyScene) {
  const cv::Mat texture = Texture();
  ImageMotion motion;
  motion.Update(texture({40, 40, 640, 480}));
  EXPECT_THAT(motion.Update(texture({40, 40, 320, 240})), IsEmpty());
  EXPECT_FALSE(motion.Update(texture({41, 40, 320, 240})).empty());
  const cv::Mat plain(240, 320, CV_8UC3, cv::Scalar(90, 90, 90));
  motion.Update(plain);
  EXPECT_THAT(motion.Update(plain), IsEmpty());
}

}  // namespace
}  // namespace dynamic_slam
