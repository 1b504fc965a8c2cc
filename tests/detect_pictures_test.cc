// The pictures of `dynamic_slam detect --images`: what the detector saw is red, what compensation filled in
// is green. The program is run, as its users do.

#include <cstdlib>

#include <fmt/core.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "dynamic_slam/base/test_folder.h"

namespace dynamic_slam {
namespace {

class DetectPicturesTest : public FolderTest {
 protected:
  // A person at the same place in all of 12 grey images, whom the detector misses in the last.
  void Run(const std::string& compensation) {
    std::filesystem::create_directories(folder_ / "images");
    std::string boxes = "timestamp,class,score,x,y,w,h\n";
    for (int i = 0; i < 12; ++i) {
      cv::imwrite(folder_ / fmt::format("images/{:02}.png", i), cv::Mat(120, 160, CV_8UC1, cv::Scalar(100)));
      if (i < 11) boxes += fmt::format("{:.9f},person,0.9,50,40,40,60\n", i / 30.0);
    }
    Write("boxes.csv", boxes);
    const std::string command = fmt::format(
        "'{}' detect '{}/images' --detector 'boxes:{}/boxes.csv' --out '{}/out.csv' --images '{}/pictures' "
        "--compensation {} --quiet > /dev/null",
        DYNAMIC_SLAM_PROGRAM, folder_.string(), folder_.string(), folder_.string(), folder_.string(),
        compensation);
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
  }

  // Pixels of the picture in which this channel (2: red, 1: green) is far above the other two.
  int Coloured(int picture, int channel) const {
    const cv::Mat image = cv::imread(folder_ / fmt::format("pictures/{:06}.jpg", picture));
    EXPECT_EQ(image.size(), cv::Size(160, 120));
    int count = 0;
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const cv::Vec3b& pixel = image.at<cv::Vec3b>(y, x);
        const int others = std::max(pixel[(channel + 1) % 3], pixel[(channel + 2) % 3]);
        count += pixel[channel] > others + 40 ? 1 : 0;
      }
    }
    return count;
  }
};

constexpr int kGreen = 1, kRed = 2;
constexpr int kBorder = 150;  // of the 200 px around the box

TEST_F(DetectPicturesTest, DetectedIsRedAndFilledInGreen) {
  Run("tracker");
  EXPECT_GT(Coloured(5, kRed), kBorder);
  EXPECT_EQ(Coloured(5, kGreen), 0);
  EXPECT_GT(Coloured(11, kGreen), kBorder);
  EXPECT_EQ(Coloured(11, kRed), 0);
}

TEST_F(DetectPicturesTest, WithoutCompensationNothingIsGreen) {
  Run("none");
  EXPECT_GT(Coloured(5, kRed), kBorder);
  EXPECT_EQ(Coloured(11, kGreen), 0);
  EXPECT_EQ(Coloured(11, kRed), 0);
}

}  // namespace
}  // namespace dynamic_slam
