#include "dynamic_slam/features/patch_alignment.h"

#include <cmath>

#include <Eigen/LU>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace dynamic_slam {
namespace {

constexpr int kSide = 120;

// A smooth texture, and what becomes of it when its pixels go to `center` + A (px - center).
double Texture(double x, double y) {
  return 128 + 40 * std::sin(0.45 * x + 0.1 * y) + 35 * std::cos(0.5 * y - 0.15 * x) +
         15 * std::sin(0.21 * x * 0.21 * y);
}
cv::Mat Draw(const Eigen::Matrix2d& A, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
             double contrast = 1, double brightness = 0) {
  cv::Mat image(kSide, kSide, CV_8UC1);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const Eigen::Vector2d px = from + A.inverse() * (Eigen::Vector2d(x, y) - to);
      image.at<uint8_t>(y, x) = cv::saturate_cast<uint8_t>(contrast * Texture(px.x(), px.y()) + brightness);
    }
  }
  return image;
}

class PatchAlignmentTest : public testing::Test {
 protected:
  const Eigen::Vector2d from_{60.3, 58.7}, to_{57.85, 61.2};
  const Patch patch_ = *CutPatch(Draw(Eigen::Matrix2d::Identity(), from_, from_), from_.cast<float>());
};

TEST_F(PatchAlignmentTest, FindsAMovedPatchToAFractionOfAPixel) {
  const cv::Mat level = Draw(Eigen::Matrix2d::Identity(), from_, to_);
  for (const Eigen::Vector2f& off :
       {Eigen::Vector2f(0, 0), Eigen::Vector2f(1.5f, -1), Eigen::Vector2f(-1, -1.5f)}) {
    const auto found = AlignPatch(patch_, level, Eigen::Matrix2f::Identity(), to_.cast<float>() + off);
    ASSERT_TRUE(found.has_value()) << off.transpose();
    EXPECT_LT((*found - to_.cast<float>()).norm(), 0.05) << off.transpose();
  }
}

TEST_F(PatchAlignmentTest, FindsItTurnedEnlargedAndInOtherLight) {
  Eigen::Matrix2d A;
  A << 1.1 * std::cos(0.6), -1.1 * std::sin(0.6), 1.1 * std::sin(0.6), 1.1 * std::cos(0.6);
  const cv::Mat level = Draw(A, from_, to_, 0.6, 40);
  const auto found =
      AlignPatch(patch_, level, A.cast<float>(), to_.cast<float>() + Eigen::Vector2f(0.8f, 0.7f));
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - to_.cast<float>()).norm(), 0.05);
}

TEST_F(PatchAlignmentTest, WhatIsNotThereIsNotFound) {
  const cv::Mat inverted = 255 - Draw(Eigen::Matrix2d::Identity(), from_, to_);
  EXPECT_FALSE(AlignPatch(patch_, inverted, Eigen::Matrix2f::Identity(), to_.cast<float>()).has_value());
  cv::Mat noise(kSide, kSide, CV_8UC1);
  cv::RNG random(3);
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  EXPECT_FALSE(AlignPatch(patch_, noise, Eigen::Matrix2f::Identity(), to_.cast<float>()).has_value());
  const cv::Mat flat(kSide, kSide, CV_8UC1, cv::Scalar(90));
  EXPECT_FALSE(AlignPatch(patch_, flat, Eigen::Matrix2f::Identity(), to_.cast<float>()).has_value());
}

TEST_F(PatchAlignmentTest, FlatPatchesAndEdgesHaveNoPlace) {
  const Eigen::Vector2f middle(60, 60);
  const cv::Mat flat(kSide, kSide, CV_8UC1, cv::Scalar(90));
  cv::Mat edge = flat.clone();
  edge.colRange(60, kSide).setTo(200);
  for (const cv::Mat& image : {flat, edge}) {
    const auto patch = CutPatch(image, middle);
    ASSERT_TRUE(patch.has_value());
    EXPECT_FALSE(AlignPatch(*patch, image, Eigen::Matrix2f::Identity(), middle).has_value());
  }
}

TEST_F(PatchAlignmentTest, NothingIsReadBesideTheImage) {
  const cv::Mat image = Draw(Eigen::Matrix2d::Identity(), from_, from_);
  for (const Eigen::Vector2f& at :
       {Eigen::Vector2f(5.9f, 60), Eigen::Vector2f(60, 5.9f), Eigen::Vector2f(113, 60),
        Eigen::Vector2f(60, 113), Eigen::Vector2f(-50, 60), Eigen::Vector2f(NAN, 60)}) {
    EXPECT_FALSE(CutPatch(image, at).has_value()) << at.transpose();
  }
  EXPECT_TRUE(CutPatch(image, {6, 112.9f}).has_value());
  for (const Eigen::Vector2f& at :
       {Eigen::Vector2f(4, 60), Eigen::Vector2f(60, 116), Eigen::Vector2f(1e9f, 0)}) {
    EXPECT_FALSE(AlignPatch(patch_, image, Eigen::Matrix2f::Identity(), at).has_value()) << at.transpose();
  }
}

}  // namespace
}  // namespace dynamic_slam
