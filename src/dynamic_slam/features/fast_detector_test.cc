#include "dynamic_slam/features/fast_detector.h"

#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

cv::Mat Noise(int width, int height, uint64_t seed) {
  Random random(seed);
  cv::Mat image(height, width, CV_8UC1);
  for (uint8_t& value : cv::Mat_<uint8_t>(image)) value = static_cast<uint8_t>(random.Index(256));
  cv::GaussianBlur(image, image, {}, 1.2);
  return image;
}

std::vector<Corner> Detect(const cv::Mat& image, int border, int threshold) {
  std::vector<Corner> corners;
  FastDetector().Detect(image, border, threshold, &corners);
  return corners;
}

class FastDetectorSizes : public testing::TestWithParam<cv::Size> {};

// Widths around multiples of the vector length, where loops end differently.
TEST_P(FastDetectorSizes, FindsWhatOpenCvFinds) {
  const cv::Mat image = Noise(GetParam().width, GetParam().height, 7);
  constexpr int kBorder = 4, kThreshold = 15;
  const auto inside = [&](const cv::KeyPoint& k) {
    return k.pt.x >= kBorder && k.pt.y >= kBorder && k.pt.x < static_cast<float>(image.cols - kBorder) &&
           k.pt.y < static_cast<float>(image.rows - kBorder);
  };
  // OpenCV's maxima must be above their neighbours, ours need only not be below those that follow.
  std::vector<cv::KeyPoint> strict, all;
  cv::FAST(image, strict, kThreshold, true);
  cv::FAST(image, all, kThreshold, false);
  std::map<std::pair<int, int>, int> ours;
  for (const Corner& corner : Detect(image, kBorder, kThreshold)) ours[{corner.x, corner.y}] = corner.score;
  EXPECT_FALSE(ours.empty());
  for (const cv::KeyPoint& k : strict) {
    if (!inside(k)) continue;
    const auto found = ours.find({cvRound(k.pt.x), cvRound(k.pt.y)});
    ASSERT_NE(found, ours.end()) << k.pt;
    // OpenCV's response is the largest threshold that the contrast exceeds.
    EXPECT_EQ(found->second, cvRound(k.response) + 1) << k.pt;
  }
  size_t also_theirs = 0;
  for (const cv::KeyPoint& k : all) also_theirs += ours.count({cvRound(k.pt.x), cvRound(k.pt.y)});
  EXPECT_EQ(also_theirs, ours.size());
}

INSTANTIATE_TEST_SUITE_P(Sizes, FastDetectorSizes,
                         testing::Values(cv::Size(200, 150), cv::Size(40, 200), cv::Size(71, 60),
                                         cv::Size(72, 60), cv::Size(73, 60), cv::Size(39, 61),
                                         cv::Size(103, 33)));

TEST(FastDetector, AHigherThresholdKeepsTheStrongCorners) {
  const cv::Mat image = Noise(200, 150, 8);
  size_t strong = 0;
  for (const Corner& corner : Detect(image, 4, 7)) strong += corner.score > 30;
  EXPECT_EQ(Detect(image, 4, 30).size(), strong);
  EXPECT_GT(strong, 10u);
}

TEST(FastDetector, CornersAreSortedAndWithinTheBorder) {
  const std::vector<Corner> corners = Detect(Noise(200, 150, 9), 19, 10);
  EXPECT_TRUE(std::is_sorted(corners.begin(), corners.end(), [](const Corner& a, const Corner& b) {
    return a.y != b.y ? a.y < b.y : a.x < b.x;
  }));
  for (const Corner& corner : corners) {
    EXPECT_TRUE(corner.x >= 19 && corner.x < 181 && corner.y >= 19 && corner.y < 131);
    EXPECT_LE(std::abs(corner.dx), 0.5f);
    EXPECT_LE(std::abs(corner.dy), 0.5f);
  }
}

TEST(FastDetector, ADotIsFoundBetweenThePixels) {
  for (const double shift : {-0.4, -0.2, 0.0, 0.3}) {
    cv::Mat image(41, 41, CV_8UC1);
    for (int y = 0; y < 41; ++y) {
      for (int x = 0; x < 41; ++x) {
        const double dx = x - (20 + shift), dy = y - (20 - shift);
        image.at<uint8_t>(y, x) = cv::saturate_cast<uint8_t>(200 * std::exp(-(dx * dx + dy * dy) / 4.5));
      }
    }
    const std::vector<Corner> corners = Detect(image, 4, 40);
    ASSERT_EQ(corners.size(), 1u);
    EXPECT_NEAR(corners[0].x + corners[0].dx, 20 + shift, 0.15);
    EXPECT_NEAR(corners[0].y + corners[0].dy, 20 - shift, 0.15);
  }
}

TEST(FastDetector, NothingInAFlatOrTinyImage) {
  EXPECT_THAT(Detect(cv::Mat(100, 100, CV_8UC1, cv::Scalar(77)), 4, 0), testing::IsEmpty());
  EXPECT_THAT(Detect(Noise(38, 38, 1), 19, 5), testing::IsEmpty());
  EXPECT_THAT(Detect(Noise(5, 200, 1), 19, 5), testing::IsEmpty());
}

TEST(FastDetector, RefusesOtherPixels) {
  std::vector<Corner> corners;
  EXPECT_THROW(FastDetector().Detect(cv::Mat(50, 50, CV_8UC3), 4, 5, &corners), InternalError);
}

}  // namespace
}  // namespace dynamic_slam
