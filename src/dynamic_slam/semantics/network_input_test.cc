#include "dynamic_slam/semantics/network_input.h"

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

NetworkInputOptions Square(int size_px) {
  NetworkInputOptions options;
  options.width = options.height = size_px;
  return options;
}

float At(const cv::Mat& blob, int channel, int y, int x) { return blob.ptr<float>(0, channel, y)[x]; }

TEST(NetworkInputTest, OrderMeanAndScaleOfColours) {
  const cv::Mat image(20, 40, CV_8UC3, cv::Scalar(10, 20, 30));  // blue, green, red
  NetworkInputOptions options = Square(8);
  options.mean_red = 1;
  options.mean_green = 2;
  options.mean_blue = 3;
  options.scale = 0.5;
  const cv::Mat rgb = MakeNetworkInput(image, options).blob;
  ASSERT_EQ(rgb.size[0] * rgb.size[1] * rgb.size[2] * rgb.size[3], 3 * 8 * 8);
  EXPECT_FLOAT_EQ(At(rgb, 0, 4, 4), 14.5);
  EXPECT_FLOAT_EQ(At(rgb, 1, 4, 4), 9);
  EXPECT_FLOAT_EQ(At(rgb, 2, 4, 4), 3.5);
  options.channels = "bgr";
  const cv::Mat bgr = MakeNetworkInput(image, options).blob;
  EXPECT_FLOAT_EQ(At(bgr, 0, 4, 4), 3.5);
  EXPECT_FLOAT_EQ(At(bgr, 2, 4, 4), 14.5);
}

TEST(NetworkInputTest, GreyImagesHaveThreeEqualChannels) {
  const cv::Mat blob = MakeNetworkInput(cv::Mat(8, 8, CV_8UC1, cv::Scalar(77)), Square(8)).blob;
  for (int channel = 0; channel < 3; ++channel) EXPECT_FLOAT_EQ(At(blob, channel, 0, 0), 77);
}

TEST(NetworkInputTest, PlainStretches) {
  const ImageFromInput map = MakeNetworkInput(cv::Mat(480, 640, CV_8UC3), Square(320)).image_from_input;
  const Box box = map * Box{0, 0, 320, 320};
  EXPECT_DOUBLE_EQ(box.width, 640);
  EXPECT_DOUBLE_EQ(box.height, 480);
}

TEST(NetworkInputTest, LetterboxKeepsProportionsAtTheTopLeft) {
  NetworkInputOptions options = Square(416);
  options.resize = "letterbox";
  const NetworkInput input = MakeNetworkInput(cv::Mat(480, 640, CV_8UC3, cv::Scalar::all(7)), options);
  EXPECT_FLOAT_EQ(At(input.blob, 0, 311, 415), 7);
  EXPECT_FLOAT_EQ(At(input.blob, 0, 312, 0), 114);
  const Box box = input.image_from_input * Box{104, 156, 208, 156};
  EXPECT_NEAR(box.x, 160, 1e-9);
  EXPECT_NEAR(box.y, 240, 1e-9);
  EXPECT_NEAR(box.width, 320, 1e-9);
  EXPECT_NEAR(box.height, 240, 1e-9);
}

TEST(NetworkInputTest, ASliverOfAnImageStillHasAPixel) {
  NetworkInputOptions options = Square(32);
  options.resize = "letterbox";
  EXPECT_NO_THROW(MakeNetworkInput(cv::Mat(1, 4000, CV_8UC3, cv::Scalar::all(0)), options));
}

}  // namespace
}  // namespace dynamic_slam
