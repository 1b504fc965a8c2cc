#include "dynamic_slam/tracking/witnesses.h"

#include <algorithm>
#include <array>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

constexpr std::array<double, 4> kBounds = {0, 0, 640, 480};

class WitnessesTest : public ::testing::Test {
 protected:
  void Add(float x, float y, float response, bool followed = false, bool landmark = false,
           bool candidate = true) {
    Keypoint keypoint;
    keypoint.x = keypoint.raw_x = x;
    keypoint.y = keypoint.raw_y = y;
    keypoint.response = response;
    frame_.features.keypoints.push_back(keypoint);
    frame_.features.descriptors.emplace_back();
    last_keypoints_.push_back(followed ? 5 : kNotFollowed);
    has_landmark_.push_back(landmark);
    candidates_.push_back(candidate ? kOfMany : 0);
  }

  std::vector<uint32_t> Choose() {
    frame_.grid.Build(frame_.features, kBounds);
    frame_.ClearLandmarks();
    for (uint32_t i = 0; i < has_landmark_.size(); ++i) {
      if (has_landmark_[i]) frame_.landmarks[i] = LandmarkId(i);
    }
    std::vector<uint32_t> witnesses{77};
    ChooseWitnesses(frame_, candidates_, last_keypoints_, &witnesses);
    std::ranges::sort(witnesses);
    return witnesses;
  }

  Frame frame_;
  std::vector<uint32_t> last_keypoints_;
  std::vector<bool> has_landmark_;
  std::vector<uint32_t> candidates_;
};

TEST_F(WitnessesTest, InACellTheStrongestCornerOfThoseThatWereFollowed) {
  Add(2, 2, 50);
  Add(3, 9, 20, true);
  Add(12, 5, 30, true);
  Add(100, 100, 7);
  Add(101, 100, 9);
  Add(100, 101, 8);
  EXPECT_THAT(Choose(), ::testing::ElementsAre(2, 4));
}

TEST_F(WitnessesTest, AllWithALandmark) {
  Add(2, 2, 50, true);
  Add(3, 9, 20, false, true);
  Add(12, 5, 30, true, true);
  EXPECT_THAT(Choose(), ::testing::ElementsAre(1, 2));
}

TEST_F(WitnessesTest, AllInSmallBoxes) {
  EXPECT_EQ(WitnessesOf({100, 50, 100, 100}), kOfFew);
  EXPECT_EQ(WitnessesOf({100, 50, 100, 300}), kOfMany);
  Add(2, 2, 50, true);
  Add(3, 9, 20);
  Add(12, 5, 30);
  candidates_[1] = kOfFew;
  candidates_[2] = kOfFew | kOfMany;
  EXPECT_THAT(Choose(), ::testing::ElementsAre(1, 2));
}

TEST_F(WitnessesTest, OnlyCandidates) {
  Add(2, 2, 50, true, false, false);
  Add(3, 9, 60, true, true, false);
  Add(12, 5, 7);
  Add(100, 100, 7, true, true, false);
  EXPECT_THAT(Choose(), ::testing::ElementsAre(2));
}

TEST_F(WitnessesTest, TheStrongestCornerWhereNothingIsKnownOfTheLastFrame) {
  Add(2, 2, 50);
  Add(3, 9, 60);
  last_keypoints_.assign(2, kNotFollowed);
  EXPECT_THAT(Choose(), ::testing::ElementsAre(1));
}

TEST_F(WitnessesTest, TheFirstOfEquals) {
  Add(2, 2, 50);
  Add(3, 9, 60);
  Add(9, 9, 60);
  EXPECT_THAT(Choose(), ::testing::ElementsAre(1));
}

TEST_F(WitnessesTest, NoCellIsWithoutOne) {
  Random random(1);
  for (int i = 0; i < 4000; ++i) {
    Add(static_cast<float>(random.Uniform(0, 640)), static_cast<float>(random.Uniform(0, 480)),
        static_cast<float>(random.Uniform(7, 100)), random.Uniform(0, 1) < 0.3, random.Uniform(0, 1) < 0.1);
  }
  const std::vector<uint32_t> witnesses = Choose();
  EXPECT_EQ(std::ranges::adjacent_find(witnesses), witnesses.end());
  frame_.grid.ForEachCell([&](std::span<const uint32_t> cell) {
    const auto is_witness = [&](uint32_t i) { return std::ranges::binary_search(witnesses, i); };
    const auto must_be = [&](uint32_t i) { return has_landmark_[i]; };
    EXPECT_TRUE(std::ranges::all_of(cell, [&](uint32_t i) { return !must_be(i) || is_witness(i); }));
    const auto needed = std::ranges::count_if(cell, must_be);
    EXPECT_EQ(std::ranges::count_if(cell, is_witness), std::max<std::ptrdiff_t>(1, needed));
  });
}

TEST_F(WitnessesTest, WhatWasNotFollowedGetsTheMeanOfItsCell) {
  Add(2, 2, 9, true);
  Add(3, 9, 9);
  Add(12, 5, 9, true);
  Add(17, 5, 9);  // in the next one
  Add(100, 100, 9);
  Choose();
  std::vector<float> log_odds{-1, 0, 2, 0, 0};
  ShareInCells(frame_.grid, last_keypoints_, log_odds);
  EXPECT_THAT(log_odds, ::testing::ElementsAre(-1, 0.5f, 2, 0, 0));
}

TEST_F(WitnessesTest, AFrameWithoutKeypointsHasNone) { EXPECT_TRUE(Choose().empty()); }

}  // namespace
}  // namespace dynamic_slam
