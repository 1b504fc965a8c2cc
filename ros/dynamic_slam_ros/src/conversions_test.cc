#include "conversions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

using testing::HasSubstr;

TEST(StampTest, ReadsAsTheTextOfAFileDoes) {
  EXPECT_EQ(StampSeconds(ros::Time(1305031452, 791720000)), 1305031452.791720);
  EXPECT_EQ(StampSeconds(ros::Time(1305031452, 5)), 1305031452.000000005);
  EXPECT_EQ(StampSeconds(ros::Time(0, 100000000)), 0.1);
}

TEST(StampTest, IsMadeOfTheTextOfANumber) {
  EXPECT_EQ(StampFromSeconds(1305031452.791720), ros::Time(1305031452, 791720000));
  EXPECT_EQ(StampFromSeconds(7), ros::Time(7, 0));
  EXPECT_EQ(StampFromSeconds(0.1), ros::Time(0, 100000000));
  EXPECT_NEAR(StampSeconds(StampFromSeconds(1.0 / 3)), 1.0 / 3, 1e-9);
  EXPECT_NEAR(StampSeconds(StampFromSeconds(1e-7)), 1e-7, 1e-12);
  EXPECT_EQ(StampFromSeconds(-1), ros::Time(0, 0));
}

sensor_msgs::Image Message(const std::string& encoding, uint32_t width, uint32_t height,
                           std::vector<uint8_t> data) {
  sensor_msgs::Image message;
  message.encoding = encoding;
  message.width = width;
  message.height = height;
  message.step = static_cast<uint32_t>(data.size() / height);
  message.data = std::move(data);
  return message;
}

TEST(ImageFromMessageTest, KnowsTheOrderOfColours) {
  std::string reason;
  const cv::Vec3b bgr(1, 2, 3);
  EXPECT_EQ(ImageFromMessage(Message("bgr8", 1, 1, {1, 2, 3}), &reason).at<cv::Vec3b>(0), bgr);
  EXPECT_EQ(ImageFromMessage(Message("rgb8", 1, 1, {3, 2, 1}), &reason).at<cv::Vec3b>(0), bgr);
  EXPECT_EQ(ImageFromMessage(Message("rgba8", 1, 1, {3, 2, 1, 9}), &reason).at<cv::Vec4b>(0),
            cv::Vec4b(1, 2, 3, 9));
  EXPECT_EQ(ImageFromMessage(Message("mono8", 2, 1, {4, 5}), &reason).at<uint8_t>(1), 5);
  EXPECT_EQ(reason, "");
}

// A red surface: only the red cells are lit.
TEST(ImageFromMessageTest, KnowsTheBayerPatterns) {
  for (const std::string pattern : {"rggb", "bggr", "gbrg", "grbg"}) {
    std::vector<uint8_t> data(8 * 8, 0);
    for (size_t y = 0; y < 8; ++y) {
      for (size_t x = 0; x < 8; ++x) data[8 * y + x] = pattern[2 * (y % 2) + x % 2] == 'r' ? 200 : 0;
    }
    std::string reason;
    const cv::Mat image = ImageFromMessage(Message("bayer_" + pattern + "8", 8, 8, data), &reason);
    EXPECT_EQ(image.at<cv::Vec3b>(4, 4), cv::Vec3b(0, 0, 200)) << pattern;
  }
}

TEST(ImageFromMessageTest, KnowsPaddedRowsAndTheOrderOfBytes) {
  std::string reason;
  EXPECT_EQ(ImageFromMessage(Message("mono8", 1, 2, {7, 0, 0, 8, 0, 0}), &reason).at<uint8_t>(1, 0), 8);
  sensor_msgs::Image big = Message("mono16", 1, 1, {1, 2});
  EXPECT_EQ(ImageFromMessage(big, &reason).at<uint16_t>(0), 0x0201);
  big.is_bigendian = 1;
  EXPECT_EQ(ImageFromMessage(big, &reason).at<uint16_t>(0), 0x0102);
}

TEST(ImageFromMessageTest, RefusesWhatDoesNotFit) {
  std::string reason;
  EXPECT_TRUE(ImageFromMessage(Message("yuv422", 1, 1, {1, 2}), &reason).empty());
  EXPECT_THAT(reason, HasSubstr("'yuv422' is not known"));
  sensor_msgs::Image cut = Message("bgr8", 2, 2, std::vector<uint8_t>(12));
  cut.data.resize(11);
  EXPECT_TRUE(ImageFromMessage(cut, &reason).empty());
  EXPECT_THAT(reason, HasSubstr("11 bytes are not 2 x 2 px"));
  cut.width = cut.height = cut.step = 0xffffffff;
  EXPECT_TRUE(ImageFromMessage(cut, &reason).empty());
  sensor_msgs::CompressedImage compressed;
  compressed.data = {1, 2, 3};
  EXPECT_TRUE(ImageFromMessage(compressed, &reason).empty());
  EXPECT_EQ(reason, "the image cannot be decoded");
}

TEST(ImageFromMessageTest, ReadsImageFiles) {
  cv::Mat image(20, 30, CV_8UC3);
  cv::randu(image, 0, 255);
  sensor_msgs::CompressedImage message;
  cv::imencode(".png", image, message.data);
  std::string reason;
  EXPECT_EQ(cv::norm(ImageFromMessage(message, &reason), image, cv::NORM_INF), 0);
}

TEST(ImageFromMessageTest, ReadsWhatMessageFromImageMakes) {
  for (const int type : {CV_8UC1, CV_8UC3}) {
    cv::Mat image(20, 30, type);
    cv::randu(image, 0, 255);
    std::string reason;
    EXPECT_EQ(cv::norm(ImageFromMessage(MessageFromImage(image.colRange(3, 30), {}), &reason),
                       image.colRange(3, 30), cv::NORM_INF),
              0);
  }
}

Camera SomeCamera() {
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 517.3;
  camera.fy = 516.5;
  camera.cx = 318.6;
  camera.cy = 255.3;
  camera.k1 = 0.26;
  camera.k2 = -0.95;
  camera.p1 = -0.005;
  camera.p2 = 0.003;
  camera.k3 = 1.16;
  return camera;
}

TEST(CameraFromMessageTest, ReadsWhatMessageFromCameraMakes) {
  const auto numbers = [](const Camera& c) {
    return std::tuple(c.width, c.height, c.model, c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3, c.k4);
  };
  Camera camera = SomeCamera();
  EXPECT_EQ(numbers(CameraFromMessage(MessageFromCamera(camera))), numbers(camera));
  camera.model = LensModel::kKannalaBrandt;
  camera.k1 = 0.01;
  camera.k2 = camera.p1 = camera.p2 = 0;
  camera.k3 = 0.002;
  camera.k4 = 0.001;
  EXPECT_EQ(numbers(CameraFromMessage(MessageFromCamera(camera))), numbers(camera));
}

TEST(CameraFromMessageTest, RefusesWhatItCannotUse) {
  const sensor_msgs::CameraInfo good = MessageFromCamera(SomeCamera());
  sensor_msgs::CameraInfo bad = good;
  bad.K[0] = 0;
  EXPECT_THROW(CameraFromMessage(bad), InputError);
  bad = good;
  bad.binning_x = 2;
  EXPECT_THROW(CameraFromMessage(bad), InputError);
  bad = good;
  bad.roi.x_offset = 8;
  EXPECT_THROW(CameraFromMessage(bad), InputError);
  bad = good;
  bad.distortion_model = "thin_prism";
  EXPECT_THROW(CameraFromMessage(bad), InputError);
  bad = good;
  bad.distortion_model = "rational_polynomial";
  bad.D = {0.1, 0, 0, 0, 0, 0.2, 0, 0};
  EXPECT_THROW(CameraFromMessage(bad), InputError);
}

}  // namespace
}  // namespace dynamic_slam
