#include "dynamic_slam/features/orb_extractor.h"

#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

Camera TestCamera(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 500;
  camera.cx = width / 2.0;
  camera.cy = height / 2.0;
  return camera;
}

cv::Mat Noise(int width, int height) {
  cv::Mat image(height, width, CV_8UC1);
  Random random(1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image.at<uint8_t>(y, x) = static_cast<uint8_t>(random.Index(256));
  }
  return image;
}

TEST(OrbExtractor, GivesAsManyFeaturesAsAskedFor) {
  OrbExtractor extractor(OrbOptions(), TestCamera(640, 480));
  FeatureSet features;
  extractor.Extract(Noise(640, 480), cv::Mat(), &features);
  EXPECT_EQ(features.size(), 1000u);
  EXPECT_EQ(features.descriptors.size(), 1000u);
}

TEST(OrbExtractor, ABlankImageHasNoFeatures) {
  OrbExtractor extractor(OrbOptions(), TestCamera(640, 480));
  FeatureSet features;
  features.keypoints.resize(3);
  extractor.Extract(cv::Mat(480, 640, CV_8UC1, cv::Scalar(90)), cv::Mat(), &features);
  EXPECT_EQ(features.size(), 0u);
}

}  // namespace
}  // namespace dynamic_slam
