#include "dynamic_slam/features/orb_extractor.h"

#include <cmath>
#include <cstring>
#include <numbers>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/features/undistortion_table.h"

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

Camera DistortedCamera() {  // tum_fr1
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 517.306408;
  camera.fy = 516.469215;
  camera.cx = 318.643040;
  camera.cy = 255.313989;
  camera.k1 = 0.262383;
  camera.k2 = -0.953104;
  camera.p1 = -0.005358;
  camera.p2 = 0.002628;
  camera.k3 = 1.163314;
  return camera;
}

// Rectangles of all sizes and greys, with a little noise.
cv::Mat Texture(int width, int height, uint64_t seed) {
  Random random(seed);
  cv::Mat image(height, width, CV_8UC1, cv::Scalar(128));
  for (int i = 0; i < width * height / 500; ++i) {
    const cv::Point2f at(static_cast<float>(random.Uniform(0, width)),
                         static_cast<float>(random.Uniform(0, height)));
    const cv::Size2f size(static_cast<float>(random.Uniform(4, 50)),
                          static_cast<float>(random.Uniform(4, 50)));
    std::vector<cv::Point2f> corners(4);
    cv::RotatedRect(at, size, static_cast<float>(random.Uniform(0, 90))).points(corners.data());
    cv::fillConvexPoly(image, std::vector<cv::Point>(corners.begin(), corners.end()),
                       cv::Scalar(random.Index(256)));
  }
  cv::GaussianBlur(image, image, {}, 1.0);
  for (uint8_t& value : cv::Mat_<uint8_t>(image))
    value = cv::saturate_cast<uint8_t>(value + random.Gaussian());
  return image;
}

FeatureSet Extract(const cv::Mat& image, const Camera& camera, const cv::Mat& mask = cv::Mat(),
                   const OrbOptions& options = OrbOptions()) {
  OrbExtractor extractor(options, camera);
  FeatureSet features;
  extractor.Extract(image, mask, &features);
  return features;
}

bool SameBytes(const FeatureSet& a, const FeatureSet& b) {
  return a.size() == b.size() && a.descriptors == b.descriptors &&
         (a.size() == 0 || std::memcmp(a.keypoints.data(), b.keypoints.data(), a.size() * sizeof(Keypoint)) == 0);
}

double AngleDifference(double a, double b) { return std::abs(std::remainder(a - b, 2 * std::numbers::pi)); }

// How well features are found again in a warped image.
struct Repetition {
  int expected = 0;  // features whose place is well inside the warped image, too
  int repeated = 0;  // of these, found within 1.5 px of their octave
  int similar = 0;   // of these, with a descriptor nearer than 50 bits
  double error = 0;  // mean distance, px of the octave
  double angle = 0;  // mean difference of the angles less the rotation, rad
};

// warp: 2x3, raw px to raw px, a rotation by -angle_rad (clockwise in the image) times a scale.
Repetition Compare(const FeatureSet& before, const FeatureSet& after, const cv::Mat& warp,
                   const std::vector<float>& scales, double margin_px) {
  Repetition result;
  const double rotation = std::atan2(warp.at<double>(1, 0), warp.at<double>(0, 0));
  const double scale = std::hypot(warp.at<double>(1, 0), warp.at<double>(0, 0));
  for (size_t i = 0; i < before.size(); ++i) {
    const Keypoint& from = before.keypoints[i];
    const cv::Mat to = warp * (cv::Mat_<double>(3, 1) << from.raw_x, from.raw_y, 1);
    const double x = to.at<double>(0), y = to.at<double>(1), size = scales[from.octave] * scale;
    if (x < margin_px || y < margin_px || x > 640 - margin_px || y > 480 - margin_px) continue;
    if (size < 0.99 || size > scales.back() * 1.01) continue;
    ++result.expected;
    double best = 1.5;
    size_t match = after.size();
    for (size_t j = 0; j < after.size(); ++j) {
      const Keypoint& candidate = after.keypoints[j];
      const double distance = std::hypot(candidate.raw_x - x, candidate.raw_y - y) / scales[candidate.octave];
      if (distance >= best || std::abs(std::log(scales[candidate.octave] / size)) > std::log(1.15)) continue;
      best = distance;
      match = j;
    }
    if (match == after.size()) continue;
    ++result.repeated;
    result.similar += HammingDistance(before.descriptors[i], after.descriptors[match]) < 50;
    result.error += best;
    result.angle += AngleDifference(after.keypoints[match].angle_rad, from.angle_rad + rotation);
  }
  result.error /= std::max(1, result.repeated);
  result.angle /= std::max(1, result.repeated);
  return result;
}

class OrbUnderWarp : public testing::TestWithParam<std::pair<double, double>> {};

TEST_P(OrbUnderWarp, FeaturesAreFoundAgainAndDescribedAlike) {
  const auto [angle_deg, scale] = GetParam();
  const cv::Mat image = Texture(640, 480, 3);
  const cv::Mat warp = cv::getRotationMatrix2D({319.5f, 239.5f}, angle_deg, scale);
  cv::Mat warped;
  cv::warpAffine(image, warped, warp, image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT_101);
  OrbOptions options;
  options.features = 1500;
  OrbExtractor extractor(options, TestCamera(640, 480));
  FeatureSet before, after;
  extractor.Extract(image, cv::Mat(), &before);
  extractor.Extract(warped, cv::Mat(), &after);
  const Repetition result = Compare(before, after, warp, OctaveScales(options), 80);
  RecordProperty("expected", result.expected);
  EXPECT_GT(result.expected, 200);
  // At another scale the same number of features stands for another area.
  EXPECT_GT(result.repeated, (scale == 1 ? 0.6 : 0.35) * result.expected);
  EXPECT_GT(result.similar, 0.8 * result.repeated);
  EXPECT_LT(result.error, 0.6);
  EXPECT_LT(result.angle, 0.2);
}

INSTANTIATE_TEST_SUITE_P(RotationAndScale, OrbUnderWarp,
                         testing::Values(std::pair{0.0, 1.0}, std::pair{30.0, 1.0}, std::pair{90.0, 1.0},
                                         std::pair{200.0, 1.0}, std::pair{0.0, 1 / 1.44},
                                         std::pair{45.0, 1.2}));

TEST(OrbExtractor, DifferentPlacesHaveDifferentDescriptors) {
  const FeatureSet a = Extract(Texture(640, 480, 4), TestCamera(640, 480));
  const FeatureSet b = Extract(Texture(640, 480, 5), TestCamera(640, 480));
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += HammingDistance(a.descriptors[i], b.descriptors[i]);
  // Bits of steered tests are not quite independent of the orientation; at random it would be 128.
  EXPECT_GT(sum / static_cast<double>(a.size()), 105);
}

TEST(OrbExtractor, GivesAsManyFeaturesAsAskedFor) {
  const cv::Mat image = Texture(640, 480, 6);
  OrbExtractor extractor(OrbOptions(), TestCamera(640, 480));
  FeatureSet features;
  extractor.Extract(image, cv::Mat(), &features);
  EXPECT_EQ(features.size(), 1000u);
  EXPECT_EQ(features.descriptors.size(), 1000u);
  extractor.SetFeatures(3000);
  extractor.Extract(image, cv::Mat(), &features);
  EXPECT_EQ(features.size(), 3000u);
  extractor.SetFeatures(20000);
  extractor.Extract(image, cv::Mat(), &features);
  EXPECT_GT(features.size(), 3000u);
  EXPECT_LE(features.size(), 20000u);
  EXPECT_THROW(extractor.SetFeatures(0), InternalError);
}

TEST(OrbExtractor, DeferredAreasGiveTheirPlacesToOthers) {
  const cv::Mat image = Texture(640, 480, 6);
  OrbExtractor extractor(OrbOptions(), TestCamera(640, 480));
  FeatureSet features;
  const auto share_inside = [&](const cv::Rect& area) {
    extractor.Extract(image, cv::Mat(), &features);
    const auto inside = std::count_if(
        features.keypoints.begin(), features.keypoints.end(),
        [&](const Keypoint& keypoint) { return area.contains(cv::Point2f(keypoint.raw_x, keypoint.raw_y)); });
    return static_cast<double>(inside) / static_cast<double>(features.size());
  };
  // Reaches out of the image, as boxes do.
  const std::vector<cv::Rect> areas{{-40, -30, 360, 560}};
  const double usual = share_inside(areas[0]);
  EXPECT_NEAR(usual, 0.5, 0.1);
  extractor.Defer(areas);
  EXPECT_LT(share_inside(areas[0]), 0.1);
  EXPECT_EQ(features.size(), 1000u);
  extractor.Defer({});
  EXPECT_EQ(share_inside(areas[0]), usual);
}

TEST(OrbExtractor, ALowerThresholdFindsWeakerCorners) {
  cv::Mat image = Texture(640, 480, 6);
  image.convertTo(image, -1, 0.05, 100);  // contrasts of some 6 grey levels
  OrbOptions options;
  options.features = 20000;
  OrbExtractor extractor(options, TestCamera(640, 480));
  FeatureSet usual, more, again;
  extractor.Extract(image, cv::Mat(), &usual);
  extractor.SetMinThreshold(options.fast_threshold_starved);
  extractor.Extract(image, cv::Mat(), &more);
  EXPECT_GT(more.size(), 1.5 * static_cast<double>(usual.size()));
  extractor.SetMinThreshold(options.fast_threshold_min);
  extractor.Extract(image, cv::Mat(), &again);
  EXPECT_TRUE(SameBytes(usual, again));
  EXPECT_THROW(extractor.SetMinThreshold(0), InternalError);
}

TEST(OrbExtractor, EachOctaveGetsItsShare) {
  const FeatureSet features = Extract(Texture(640, 480, 6), TestCamera(640, 480));
  std::vector<int> counts(8);
  for (const Keypoint& keypoint : features.keypoints) ++counts[keypoint.octave];
  for (int i = 1; i < 8; ++i) EXPECT_NEAR(counts[i] * 1.2, counts[i - 1], 2.5) << i;
}

TEST(OrbExtractor, ScalesAreAGeometricSeries) {
  const std::vector<float> scales = OctaveScales(OrbOptions());
  ASSERT_EQ(scales.size(), 8u);
  for (int i = 0; i < 8; ++i) EXPECT_NEAR(scales[i], std::pow(1.2, i), 1e-5);
}

TEST(OrbExtractor, TheSameImageGivesTheSameBytes) {
  const cv::Mat image = Texture(640, 480, 7);
  OrbExtractor extractor(OrbOptions(), DistortedCamera());
  FeatureSet first, other, again;
  extractor.Extract(image, cv::Mat(), &first);
  extractor.Extract(Texture(640, 480, 8), cv::Mat(), &other);
  extractor.Extract(image, cv::Mat(), &again);
  EXPECT_TRUE(SameBytes(first, again));
  EXPECT_FALSE(SameBytes(first, other));
  EXPECT_TRUE(SameBytes(first, Extract(image, DistortedCamera())));
}

TEST(OrbExtractor, AnyNumberOfThreadsGivesTheSameBytes) {
  const cv::Mat image = Texture(640, 480, 8);
  cv::Mat mask = cv::Mat::zeros(480, 640, CV_8UC1);
  mask(cv::Rect(300, 100, 150, 300)) = 1;
  const std::vector<cv::Rect> deferred{{0, 0, 200, 480}};
  const auto extract = [&](int threads) {
    OrbOptions options;
    options.threads = threads;
    OrbExtractor extractor(options, DistortedCamera());
    extractor.Defer(deferred);
    std::vector<FeatureSet> sets(3);
    for (FeatureSet& features : sets) extractor.Extract(image, mask, &features);
    return sets;
  };
  const FeatureSet alone = extract(1)[0];
  EXPECT_EQ(alone.size(), 1000u);
  for (const int threads : {0, 2, 3, 16}) {
    for (const FeatureSet& features : extract(threads)) EXPECT_TRUE(SameBytes(features, alone)) << threads;
  }
}

TEST(OrbExtractor, NothingOfTheImageIsKeptOrChanged) {
  cv::Mat image = Texture(640, 480, 7);
  const cv::Mat copy = image.clone();
  OrbExtractor extractor(OrbOptions(), TestCamera(640, 480));
  FeatureSet features;
  extractor.Extract(image, cv::Mat(), &features);
  EXPECT_EQ(cv::norm(image, copy, cv::NORM_INF), 0);
  EXPECT_EQ(image.u->refcount, 1);
}

TEST(OrbExtractor, APartOfALargerImageCountsLikeACopy) {
  const cv::Mat large = Texture(700, 500, 9);
  const cv::Mat part = large(cv::Rect(31, 7, 640, 480));
  EXPECT_TRUE(SameBytes(Extract(part, TestCamera(640, 480)), Extract(part.clone(), TestCamera(640, 480))));
}

TEST(OrbExtractor, FeaturesAreSpreadOverAllTexturedParts) {
  // The contrast falls from left to right to a third.
  cv::Mat image = Texture(640, 480, 10);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image.at<uint8_t>(y, x) =
          cv::saturate_cast<uint8_t>(128 + (image.at<uint8_t>(y, x) - 128) * (1.0 - 0.67 * x / image.cols));
    }
  }
  const FeatureSet features = Extract(image, TestCamera(640, 480));
  int counts[6][6] = {};
  for (const Keypoint& k : features.keypoints) {
    ++counts[static_cast<int>(k.raw_y) / 80][static_cast<int>(k.raw_x * 6 / 640)];
  }
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      EXPECT_GE(counts[row][column], 4) << row << " " << column;
      EXPECT_LE(counts[row][column], 70) << row << " " << column;
    }
  }
}

TEST(OrbExtractor, TheMaskIsEmptyOfFeaturesAndTheRestIsFull) {
  cv::Mat mask = cv::Mat::zeros(480, 640, CV_8UC1);
  mask(cv::Rect(200, 100, 250, 300)) = 1;
  const FeatureSet features = Extract(Texture(640, 480, 11), TestCamera(640, 480), mask);
  EXPECT_EQ(features.size(), 1000u);
  for (const Keypoint& k : features.keypoints) {
    // Masked by the pixel of the octave: up to half of its size from the edge.
    EXPECT_FALSE(k.raw_x > 202 && k.raw_x < 447 && k.raw_y > 102 && k.raw_y < 397)
        << k.raw_x << " " << k.raw_y;
  }
  EXPECT_EQ(
      Extract(Texture(640, 480, 11), TestCamera(640, 480), cv::Mat(480, 640, CV_8UC1, cv::Scalar(1))).size(),
      0u);
}

TEST(OrbExtractor, PositionsAreRawAndIdeal) {
  const Camera camera = DistortedCamera();
  const FeatureSet features = Extract(Texture(640, 480, 12), camera);
  double largest_shift = 0;
  for (const Keypoint& k : features.keypoints) {
    const Eigen::Vector2d ideal = camera.Undistort({k.raw_x, k.raw_y});
    EXPECT_NEAR(k.x, ideal.x(), 0.02);
    EXPECT_NEAR(k.y, ideal.y(), 0.02);
    largest_shift = std::max<double>(largest_shift, std::hypot(k.x - k.raw_x, k.y - k.raw_y));
  }
  EXPECT_GT(largest_shift, 5);
  for (const Keypoint& k : Extract(Texture(640, 480, 12), TestCamera(640, 480)).keypoints) {
    EXPECT_EQ(k.x, k.raw_x);
    EXPECT_EQ(k.y, k.raw_y);
  }
}

TEST(UndistortionTable, AgreesWithTheCameraUpToTheEdges) {
  Camera wide = DistortedCamera();  // an EuRoC camera
  wide.width = 752;
  wide.fx = 458.654;
  wide.fy = 457.296;
  wide.cx = 367.215;
  wide.cy = 248.375;
  wide.k1 = -0.28340811;
  wide.k2 = 0.07395907;
  wide.p1 = 0.00019359;
  wide.p2 = 1.76187114e-05;
  wide.k3 = 0;
  for (const Camera& camera : {DistortedCamera(), wide}) {
    const UndistortionTable table(camera);
    for (double y = 0; y <= camera.height - 1; y += 9.58) {
      for (double x = 0; x <= camera.width - 1; x += 7.1) {
        float u = static_cast<float>(x), v = static_cast<float>(y);
        table.Undistort(&u, &v);
        const Eigen::Vector2d ideal = camera.Undistort({x, y});
        EXPECT_NEAR(u, ideal.x(), 0.02) << x << " " << y;
        EXPECT_NEAR(v, ideal.y(), 0.02) << x << " " << y;
      }
    }
  }
}

Camera FisheyeCamera() {  // beyond 90 deg at the corners, 60 deg at about 200 px from the centre
  Camera camera = TestCamera(640, 480);
  camera.model = LensModel::kKannalaBrandt;
  camera.fx = 192.3;
  camera.fy = 191.8;
  camera.cx = 322.1;
  camera.cy = 237.6;
  camera.k1 = 0.0041;
  camera.k2 = 0.0007;
  camera.k3 = -0.0021;
  camera.k4 = 0.0002;
  return camera;
}

TEST(OrbExtractor, WhatAFisheyeCannotSeeIsDroppedAndTheRestIsFull) {
  const Camera camera = FisheyeCamera();
  const FeatureSet features = Extract(Texture(640, 480, 14), camera);
  EXPECT_EQ(features.size(), 1000u);
  const auto [min_x, min_y, max_x, max_y] = camera.IdealBounds();
  int beyond_55_deg = 0;
  for (const Keypoint& k : features.keypoints) {
    const double pixel = std::pow(1.2, k.octave);  // dropped by the pixel of the octave
    const Eigen::Vector2d from_centre(k.raw_x - camera.cx, k.raw_y - camera.cy);
    const Eigen::Vector2d nearer(k.raw_x - pixel * from_centre.normalized().x(),
                                 k.raw_y - pixel * from_centre.normalized().y());
    EXPECT_TRUE(camera.CanSee(nearer)) << k.raw_x << " " << k.raw_y;
    EXPECT_GT(k.x, min_x - 4 * pixel);
    EXPECT_LT(k.y, max_y + 4 * pixel);
    const Eigen::Vector2d ideal = camera.Undistort({k.raw_x, k.raw_y});
    EXPECT_NEAR(k.x, ideal.x(), 0.2);
    EXPECT_NEAR(k.y, ideal.y(), 0.2);
    const double tangent = camera.Unproject(ideal).head<2>().norm();
    beyond_55_deg += tangent > std::tan(55 * 3.14159 / 180);
  }
  EXPECT_GT(beyond_55_deg, 50);  // and no more than what must be
  EXPECT_GT(max_x - min_x, 600);
  EXPECT_GT(max_y - min_y, 600);
}

TEST(OrbExtractor, AFisheyesBlindnessAndTheMaskAdd) {
  const Camera camera = FisheyeCamera();
  cv::Mat mask = cv::Mat::zeros(480, 640, CV_8UC1);
  mask(cv::Rect(0, 0, 320, 480)) = 1;
  const FeatureSet features = Extract(Texture(640, 480, 14), camera, mask);
  EXPECT_GT(features.size(), 100u);
  for (const Keypoint& k : features.keypoints) {
    EXPECT_GT(k.raw_x, 317);
    EXPECT_LT(k.raw_x, 530);
  }
}

TEST(OrbExtractor, ABlankImageHasNoFeatures) {
  EXPECT_EQ(Extract(cv::Mat(480, 640, CV_8UC1, cv::Scalar(90)), TestCamera(640, 480)).size(), 0u);
}

TEST(OrbExtractor, SmallAndOddImagesWork) {
  OrbOptions options;
  options.levels = 12;
  options.scale_factor = 2.0;
  for (const cv::Size size :
       {cv::Size(1, 1), cv::Size(5, 300), cv::Size(38, 38), cv::Size(63, 47), cv::Size(333, 65)}) {
    const Camera camera = TestCamera(size.width, size.height);
    const FeatureSet features = Extract(Texture(size.width, size.height, 13), camera, cv::Mat(), options);
    for (const Keypoint& k : features.keypoints) {
      EXPECT_TRUE(k.raw_x >= 0 && k.raw_y >= 0 && k.raw_x <= static_cast<float>(size.width - 1) &&
                  k.raw_y <= static_cast<float>(size.height - 1));
    }
    if (size.width == 333) {
      EXPECT_GT(features.size(), 10u);
    }
  }
}

TEST(OrbExtractor, RefusesImagesOfAnotherSizeOrKind) {
  EXPECT_THROW(Extract(cv::Mat(480, 641, CV_8UC1), TestCamera(640, 480)), InternalError);
  EXPECT_THROW(Extract(cv::Mat(480, 640, CV_8UC3), TestCamera(640, 480)), InternalError);
  EXPECT_THROW(
      Extract(cv::Mat::zeros(480, 640, CV_8UC1), TestCamera(640, 480), cv::Mat::zeros(4, 4, CV_8UC1)),
      InternalError);
}

}  // namespace
}  // namespace dynamic_slam
