#include "dynamic_slam/io/image_preparer.h"

#include <string>

#include <gmock/gmock.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "dynamic_slam/base/test_folder.h"

namespace dynamic_slam {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Camera RawCamera() {
  Camera camera;
  camera.name = "test";
  camera.width = 64;
  camera.height = 48;
  camera.fx = 50;
  camera.fy = 52;
  camera.cx = 31;
  camera.cy = 22;
  camera.k1 = 0.01;
  return camera;
}

cv::Mat Prepared(const ImageOptions& options, const cv::Mat& raw) {
  cv::Mat grey;
  ImagePreparer(RawCamera(), options).Prepare(raw, &grey);
  EXPECT_EQ(grey.type(), CV_8UC1);
  return grey;
}

// Pixel (x, y) is x + 2 y.
cv::Mat Ramp() {
  cv::Mat ramp(48, 64, CV_8UC1);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) ramp.at<uint8_t>(y, x) = static_cast<uint8_t>(x + 2 * y);
  }
  return ramp;
}

// What a sensor with that pattern sees of an even colour; values R, G, B.
template <class T>
cv::Mat Mosaic(const std::string& pattern, const std::array<int, 3>& rgb) {
  cv::Mat raw(48, 64, cv::traits::Type<T>::value);
  for (int y = 0; y < raw.rows; ++y) {
    for (int x = 0; x < raw.cols; ++x) {
      const char colour = pattern[static_cast<size_t>(2 * (y % 2) + x % 2)];
      raw.at<T>(y, x) = static_cast<T>(rgb[colour == 'r' ? 0 : colour == 'g' ? 1 : 2]);
    }
  }
  return raw;
}

double LargestDifference(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF); }
double LargestDifference(const cv::Mat& a, double level) {
  return LargestDifference(a, cv::Mat(a.size(), a.type(), cv::Scalar(level)));
}

class ImagePreparerTest : public FolderTest {
 protected:
  std::string OptionError(const ImageOptions& options) const {
    return ErrorOf([&] { ImagePreparer preparer(RawCamera(), options); });
  }

  // The options with a mask file of that image.
  ImageOptions WithMask(const cv::Mat& mask, ImageOptions options = {}) const {
    options.mask = (folder_ / "mask.png").string();
    EXPECT_TRUE(cv::imwrite(options.mask, mask));
    return options;
  }
};

TEST_F(ImagePreparerTest, AGreyImageStaysAndSharesNoPixels) {
  const cv::Mat raw = Ramp();
  const cv::Mat grey = Prepared({}, raw);
  EXPECT_EQ(LargestDifference(grey, raw), 0);
  EXPECT_NE(grey.data, raw.data);
}

TEST_F(ImagePreparerTest, ColoursBecomeLuma) {
  const double luma = 0.114 * 10 + 0.587 * 100 + 0.299 * 200;
  EXPECT_LE(LargestDifference(Prepared({}, cv::Mat(48, 64, CV_8UC3, cv::Scalar(10, 100, 200))), luma), 1);
  EXPECT_LE(LargestDifference(Prepared({}, cv::Mat(48, 64, CV_8UC4, cv::Scalar(10, 100, 200, 7))), luma), 1);
  const cv::Scalar deep(10 * 257, 100 * 257, 200 * 257);
  EXPECT_LE(LargestDifference(Prepared({}, cv::Mat(48, 64, CV_16UC3, deep)), luma), 1);
}

// Detectors see the same part of the image in the same size, in colour.
TEST_F(ImagePreparerTest, ColourImagesKeepTheirColours) {
  ImageOptions options;
  options.crop_left = 8;
  options.resize_width = 28;
  const cv::Scalar colour(10, 100, 200);
  const auto prepared = [&options](const cv::Mat& raw) {
    cv::Mat image;
    ImagePreparer(RawCamera(), options).PrepareColour(raw, &image);
    EXPECT_EQ(image.type(), CV_8UC3);
    EXPECT_EQ(image.size(), cv::Size(28, 24));
    return image;
  };
  const auto difference = [](const cv::Mat& image, const cv::Scalar& wanted) {
    return cv::norm(image, cv::Mat(image.size(), CV_8UC3, wanted), cv::NORM_INF);
  };
  EXPECT_LE(difference(prepared(cv::Mat(48, 64, CV_8UC3, colour)), colour), 1);
  EXPECT_LE(difference(prepared(cv::Mat(48, 64, CV_8UC4, colour)), colour), 1);
  EXPECT_LE(difference(prepared(cv::Mat(48, 64, CV_16UC3, colour * 257)), colour), 1);
  EXPECT_LE(difference(prepared(cv::Mat(48, 64, CV_8UC1, cv::Scalar(77))), cv::Scalar::all(77)), 1);
  options.bayer = "grbg";
  EXPECT_LE(difference(prepared(Mosaic<uint8_t>("grbg", {200, 100, 10})), colour), 1);
}

TEST_F(ImagePreparerTest, WhiteLevelIsWhite) {
  EXPECT_EQ(LargestDifference(Prepared({}, cv::Mat(48, 64, CV_16UC1, cv::Scalar(65535))), 255), 0);
  EXPECT_EQ(LargestDifference(Prepared({}, cv::Mat(48, 64, CV_16UC1, cv::Scalar(100 * 257))), 100), 0);
  ImageOptions options;
  options.white_level = 4095;
  EXPECT_EQ(LargestDifference(Prepared(options, cv::Mat(48, 64, CV_16UC1, cv::Scalar(4095))), 255), 0);
  EXPECT_LE(LargestDifference(Prepared(options, cv::Mat(48, 64, CV_16UC1, cv::Scalar(1000))), 62.27), 0.5);
  EXPECT_EQ(LargestDifference(Prepared(options, cv::Mat(48, 64, CV_16UC1, cv::Scalar(9999))), 255), 0);
  options.white_level = 51;
  EXPECT_EQ(LargestDifference(Prepared(options, cv::Mat(48, 64, CV_8UC1, cv::Scalar(20))), 100), 0);
}

TEST_F(ImagePreparerTest, CropShiftsTheCamera) {
  ImageOptions options;
  options.crop_left = 5;
  options.crop_top = 3;
  options.crop_height = 40;
  const ImagePreparer preparer(RawCamera(), options);
  EXPECT_EQ(preparer.camera().width, 59);
  EXPECT_EQ(preparer.camera().height, 40);
  EXPECT_EQ(preparer.camera().cx, 26);
  EXPECT_EQ(preparer.camera().cy, 19);
  EXPECT_EQ(preparer.camera().fx, 50);
  EXPECT_EQ(preparer.camera().k1, 0.01);
  EXPECT_EQ(LargestDifference(Prepared(options, Ramp()), Ramp()(cv::Rect(5, 3, 59, 40))), 0);
}

TEST_F(ImagePreparerTest, ResizeKeepsWhatEachRaySees) {
  // The ramp is the same at a point of space however large the pixels are: the scaled camera must find at the
  // projection of a ray what the raw camera finds.
  for (const int width : {32, 48, 29, 96}) {
    ImageOptions options;
    options.crop_left = 1;
    options.crop_top = 2;
    options.resize_width = width;
    const Camera raw = RawCamera(), camera = ImagePreparer(raw, options).camera();
    EXPECT_EQ(camera.width, width);
    const cv::Mat grey = Prepared(options, Ramp());
    ASSERT_EQ(grey.size(), cv::Size(camera.width, camera.height));
    EXPECT_NEAR(camera.height / static_cast<double>(width), 46.0 / 63, 0.5 / width + 1e-9);
    for (int y = 2; y + 2 < grey.rows; ++y) {
      for (int x = 2; x + 2 < grey.cols; ++x) {
        const Eigen::Vector2d in_raw = raw.Project(camera.Unproject({x, y}));
        EXPECT_NEAR(grey.at<uint8_t>(y, x), in_raw.x() + 2 * in_raw.y(), 1.0)
            << width << ": " << x << ", " << y;
      }
    }
  }
}

TEST_F(ImagePreparerTest, BayerPatternsFollowTheCrop) {
  const double luma = 0.299 * 200 + 0.587 * 100 + 0.114 * 50;
  for (const char* pattern : {"rggb", "bggr", "grbg", "gbrg"}) {
    for (const cv::Point corner : {cv::Point(0, 0), cv::Point(1, 0), cv::Point(0, 1), cv::Point(3, 5)}) {
      ImageOptions options;
      options.bayer = pattern;
      options.crop_left = corner.x;
      options.crop_top = corner.y;
      EXPECT_LE(LargestDifference(Prepared(options, Mosaic<uint8_t>(pattern, {200, 100, 50})), luma), 1)
          << pattern << " " << corner.x << " " << corner.y;
      options.white_level = 4095;
      EXPECT_LE(LargestDifference(Prepared(options, Mosaic<uint16_t>(pattern, {3200, 1600, 800})),
                                  luma * 16 * 255 / 4095),
                1)
          << pattern << " " << corner.x << " " << corner.y;
    }
  }
}

TEST_F(ImagePreparerTest, MemoryIsUsedAgainAndNoImageDependsOnTheLast) {
  ImageOptions options;
  options.crop_left = 1;
  options.resize_width = 40;
  ImagePreparer preparer(RawCamera(), options);
  const cv::Mat first = Ramp(), colour(48, 64, CV_8UC3, cv::Scalar::all(9)), untouched = Ramp();
  cv::Mat grey;
  preparer.Prepare(first, &grey);
  const uint8_t* memory = grey.data;
  const cv::Mat expected = grey.clone();
  for (const cv::Mat& raw : {colour, cv::Mat(48, 64, CV_16UC1, cv::Scalar(0)), first}) {
    preparer.Prepare(raw, &grey);
    EXPECT_EQ(grey.data, memory);
  }
  EXPECT_EQ(LargestDifference(grey, expected), 0);
  EXPECT_EQ(LargestDifference(first, untouched), 0);
}

TEST_F(ImagePreparerTest, BlackOfTheMaskFileIsIgnored) {
  cv::Mat used(48, 64, CV_8UC1, cv::Scalar(255));
  used(cv::Rect(0, 40, 64, 8)) = 0;
  const cv::Mat mask = ImagePreparer(RawCamera(), WithMask(used)).mask();
  EXPECT_EQ(cv::countNonZero(mask), 64 * 8);
  EXPECT_NE(mask.at<uint8_t>(45, 3), 0);
  // Labels 0 and 1, and colour, mean the same.
  EXPECT_EQ(LargestDifference(ImagePreparer(RawCamera(), WithMask(used / 255)).mask(), mask), 0);
  cv::Mat colour;
  cv::merge(std::vector<cv::Mat>{used, used, used}, colour);
  EXPECT_EQ(LargestDifference(ImagePreparer(RawCamera(), WithMask(colour)).mask(), mask), 0);
}

TEST_F(ImagePreparerTest, AMaskOfTheRawSizeIsPreparedAsTheImagesAre) {
  cv::Mat used(48, 64, CV_8UC1, cv::Scalar(255));
  used(cv::Rect(0, 0, 64, 5)) = 0;
  ImageOptions options;
  options.crop_top = 2;
  options.crop_height = 44;
  options.resize_width = 32;
  const cv::Mat mask = ImagePreparer(RawCamera(), WithMask(used, options)).mask();
  ASSERT_EQ(mask.size(), cv::Size(32, 22));
  // Raw rows 2, 3, 4 are rows 0 and 0.5; what is partly ignored is ignored.
  EXPECT_EQ(cv::countNonZero(mask), 2 * 32);
  const cv::Mat prepared_size(22, 32, CV_8UC1, cv::Scalar(255));
  EXPECT_EQ(cv::countNonZero(ImagePreparer(RawCamera(), WithMask(prepared_size, options)).mask()), 0);
}

TEST_F(ImagePreparerTest, MasksAreMerged) {
  cv::Mat used(48, 64, CV_8UC1, cv::Scalar(255)), other = cv::Mat::zeros(48, 64, CV_8UC1);
  used.row(0) = 0;
  other.row(1) = 7;
  ImagePreparer preparer(RawCamera(), WithMask(used)), without(RawCamera(), {});
  EXPECT_EQ(cv::countNonZero(preparer.MergedMask({})), 64);
  EXPECT_EQ(cv::countNonZero(preparer.MergedMask(other)), 128);
  EXPECT_EQ(cv::countNonZero(preparer.MergedMask({})), 64) << "as before";
  EXPECT_TRUE(without.MergedMask({}).empty());
  EXPECT_EQ(cv::countNonZero(without.MergedMask(other)), 64);
  EXPECT_THROW(preparer.MergedMask(cv::Mat::zeros(3, 3, CV_8UC1)), InternalError);
}

TEST_F(ImagePreparerTest, WrongOptionsAreNamedBeforeTheFirstImage) {
  EXPECT_THAT(OptionError({.crop_left = 40, .crop_width = 30}),
              AllOf(HasSubstr("crop_width"), HasSubstr("30 x 48 px at (40, 0)"), HasSubstr("64 x 48 px")));
  EXPECT_THAT(OptionError({.crop_left = 70}), HasSubstr("is outside of"));
  EXPECT_THAT(OptionError({.crop_left = 40}), HasSubstr("leaves out the principal point (31, 22)"));
  EXPECT_THAT(OptionError({.crop_left = -1}), HasSubstr("crop_left"));
  EXPECT_THAT(OptionError({.crop_height = 8}), HasSubstr("smaller than 16 px"));
  EXPECT_THAT(OptionError({.resize_width = 8}),
              AllOf(HasSubstr("image.resize_width"), HasSubstr("8 x 6 px")));
  EXPECT_THAT(OptionError({.bayer = "rgbg"}),
              AllOf(HasSubstr("image.bayer"), HasSubstr("'rgbg'"), HasSubstr("grbg")));
  EXPECT_THAT(OptionError({.white_level = 70000}), HasSubstr("white_level"));

  EXPECT_THAT(OptionError({.mask = (folder_ / "absent.png").string()}),
              AllOf(HasSubstr("absent.png: the file is missing"), HasSubstr("image.mask")));
  EXPECT_THAT(OptionError({.mask = Write("text.png", "a text").string()}),
              HasSubstr("text.png: the image cannot"));
  EXPECT_THAT(OptionError(WithMask(cv::Mat(48, 63, CV_8UC1, cv::Scalar(255)))),
              AllOf(HasSubstr("mask.png: has 63 x 48 px"), HasSubstr("64 x 48 px")));
  EXPECT_THAT(OptionError(WithMask(cv::Mat::zeros(48, 64, CV_8UC1))), HasSubstr("Paint white"));
  cv::Mat outside = cv::Mat::zeros(48, 64, CV_8UC1);
  outside.row(47) = 255;
  EXPECT_THAT(OptionError(WithMask(outside, {.crop_height = 40})),
              HasSubstr("everything that the crop keeps"));
}

TEST_F(ImagePreparerTest, ImagesThatDoNotFitAreRefusedWithTheReason) {
  ImagePreparer preparer(RawCamera(), {});
  EXPECT_EQ(preparer.Refusal(Ramp()), "");
  EXPECT_THAT(preparer.Refusal({}), HasSubstr("its size is 0 x 0 px, that of the camera 64 x 48 px"));
  EXPECT_THAT(preparer.Refusal(cv::Mat(48, 65, CV_8UC1)), HasSubstr("65 x 48"));
  EXPECT_THAT(preparer.Refusal(cv::Mat(48, 64, CV_32FC1)), HasSubstr("neither of 8 nor of 16 bits"));
  EXPECT_THAT(preparer.Refusal(cv::Mat(48, 64, CV_8UC2)), HasSubstr("2 channels"));
  EXPECT_THAT(ImagePreparer(RawCamera(), {.bayer = "rggb"}).Refusal(cv::Mat(48, 64, CV_8UC3)),
              HasSubstr("it has 3 channels, but image.bayer is rggb"));
  EXPECT_THAT(ImagePreparer(RawCamera(), {.white_level = 4095}).Refusal(Ramp()),
              HasSubstr("its pixels are of 8 bits, but image.white_level is 4095"));
  cv::Mat grey;
  EXPECT_THAT(ErrorOf([&] { preparer.Prepare(cv::Mat(48, 64, CV_32FC1), &grey); }), HasSubstr("image.*"));
}

}  // namespace
}  // namespace dynamic_slam
