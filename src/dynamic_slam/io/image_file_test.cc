#include "dynamic_slam/io/image_file.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "dynamic_slam/base/test_folder.h"

namespace dynamic_slam {
namespace {

using ::testing::AnyOf;

// Noise, so that no encoder can make it short.
cv::Mat Noise(int type) {
  cv::Mat image(48, 64, type);
  cv::RNG random(1);
  random.fill(image, cv::RNG::UNIFORM, 0, CV_MAT_DEPTH(type) == CV_16U ? 65536 : 256);
  return image;
}

std::string Encode(const std::string& extension, const cv::Mat& image) {
  std::vector<uchar> bytes;
  EXPECT_TRUE(cv::imencode(extension, image, bytes)) << extension;
  return {bytes.begin(), bytes.end()};
}

class ImageFileTest : public FolderTest {
 protected:
  // The image in a file of these bytes, or the reason why there is none.
  cv::Mat Read(const std::string& bytes, std::string* reason) const {
    return ReadImage(Write("image", bytes), reason);
  }
};

TEST_F(ImageFileTest, GivesTheImageAsItIsStored) {
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3}) {
    std::string reason;
    const cv::Mat image = Noise(type), read = Read(Encode(".png", image), &reason);
    ASSERT_EQ(read.type(), type) << reason;
    EXPECT_EQ(cv::norm(image, read, cv::NORM_INF), 0);
    EXPECT_EQ(reason, "");
  }
}

TEST_F(ImageFileTest, NoTruncatedImageIsTakenForAWholeOne) {
  for (const char* extension : {".png", ".jpg", ".bmp", ".pgm", ".ppm", ".webp", ".tif", ".jp2"}) {
    const bool grey = std::string(extension) == ".pgm";
    const std::string bytes = Encode(extension, Noise(grey ? CV_8UC1 : CV_8UC3));
    std::string reason;
    EXPECT_FALSE(Read(bytes, &reason).empty()) << extension << ": " << reason;
    for (const size_t size : {bytes.size() - 2, bytes.size() / 2, bytes.size() / 20, size_t{5}}) {
      reason.clear();
      EXPECT_TRUE(Read(bytes.substr(0, size), &reason).empty()) << extension << " cut to " << size;
      EXPECT_THAT(reason, AnyOf("the image is truncated", "the image cannot be decoded"))
          << extension << " cut to " << size;
    }
  }
}

TEST_F(ImageFileTest, TellsTruncationByTheStructure) {
  for (const char* extension : {".png", ".jpg", ".bmp", ".pgm", ".ppm", ".webp"}) {
    const std::string bytes = Encode(extension, Noise(std::string(extension) == ".pgm" ? CV_8UC1 : CV_8UC3));
    EXPECT_FALSE(IsTruncatedImage(bytes)) << extension;
    EXPECT_FALSE(IsTruncatedImage(bytes + "more")) << extension;
    EXPECT_TRUE(IsTruncatedImage(bytes.substr(0, bytes.size() / 2))) << extension;
  }
  EXPECT_FALSE(IsTruncatedImage("P5\n# a comment 9\n2 2\n255\nabcd"));
  EXPECT_TRUE(IsTruncatedImage("P5\n# a comment 9\n2 2\n255\nabc"));
  EXPECT_TRUE(IsTruncatedImage("P5 2 2 65535 abcdefg"));
  EXPECT_TRUE(IsTruncatedImage("P6"));
  EXPECT_FALSE(IsTruncatedImage(""));
  EXPECT_FALSE(IsTruncatedImage("not an image"));
}

TEST_F(ImageFileTest, SaysWhyThereIsNone) {
  std::string reason;
  EXPECT_TRUE(ReadImage(folder_ / "absent.png", &reason).empty());
  EXPECT_EQ(reason, "the file is missing");
  EXPECT_TRUE(ReadImage(folder_, &reason).empty());
  EXPECT_EQ(reason, "the file is missing");
  EXPECT_TRUE(Read("", &reason).empty());
  EXPECT_EQ(reason, "the file is empty");
  EXPECT_TRUE(Read("a text", &reason).empty());
  EXPECT_EQ(reason, "the image cannot be decoded");
}

}  // namespace
}  // namespace dynamic_slam
