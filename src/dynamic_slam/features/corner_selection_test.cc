#include "dynamic_slam/features/corner_selection.h"

#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

std::vector<int> Shares(int wanted, const std::vector<double>& weights, const std::vector<int>& available) {
  std::vector<int> shares = {1, 2, 3, 4, 5};  // of another call
  ShareOverLevels(wanted, weights, available, &shares);
  return shares;
}

TEST(ShareOverLevels, IsInProportion) {
  EXPECT_THAT(Shares(70, {4, 2, 1}, {1000, 1000, 1000}), testing::ElementsAre(40, 20, 10));
}

TEST(ShareOverLevels, GivesOnWhatALevelCannotUse) {
  EXPECT_THAT(Shares(70, {4, 2, 1}, {10, 1000, 1000}), testing::ElementsAre(10, 40, 20));
  EXPECT_THAT(Shares(70, {4, 2, 1}, {10, 1000, 3}), testing::ElementsAre(10, 57, 3));
  EXPECT_THAT(Shares(70, {4, 2, 1}, {10, 5, 0}), testing::ElementsAre(10, 5, 0));
}

TEST(ShareOverLevels, SumsUpToTheRequest) {
  Random random(1);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<double> weights;
    std::vector<int> available;
    for (int i = 0; i < 8; ++i) {
      weights.push_back(random.Uniform(0.1, 1));
      available.push_back(static_cast<int>(random.Index(400)));
    }
    const int wanted = static_cast<int>(random.Index(2000));
    const std::vector<int> shares = Shares(wanted, weights, available);
    for (size_t i = 0; i < shares.size(); ++i) EXPECT_TRUE(shares[i] >= 0 && shares[i] <= available[i]);
    EXPECT_EQ(std::accumulate(shares.begin(), shares.end(), 0),
              std::min(wanted, std::accumulate(available.begin(), available.end(), 0)));
  }
}

// Strong corners in the left half, weak ones in the right.
std::vector<Corner> HalfStrong(int width, int height) {
  Random random(2);
  std::vector<Corner> corners;
  for (int y = 0; y < height; y += 4) {
    for (int x = 0; x < width; x += 4) {
      const int score = 10 + static_cast<int>(random.Index(5)) + (x < width / 2 ? 100 : 0);
      corners.push_back(
          {static_cast<uint16_t>(x), static_cast<uint16_t>(y), 0, 0, static_cast<uint8_t>(score)});
    }
  }
  return corners;
}

TEST(CornerSelector, SpreadsOverStrongAndWeakParts) {
  std::vector<Corner> corners = HalfStrong(320, 240);
  CornerSelector().Select(320, 240, 300, 5, {}, &corners);
  EXPECT_EQ(corners.size(), 300u);
  const auto left = std::count_if(corners.begin(), corners.end(), [](const Corner& c) { return c.x < 160; });
  EXPECT_NEAR(static_cast<double>(left), 150, 20);
}

TEST(CornerSelector, WeakCornersComeOneRoundLater) {
  std::vector<Corner> corners = HalfStrong(320, 240);
  CornerSelector().Select(320, 240, 300, 20, {}, &corners);  // the right half is weak now
  const auto left = std::count_if(corners.begin(), corners.end(), [](const Corner& c) { return c.x < 160; });
  // The second corners of the left half are stronger and of the same round; what is left goes to the right
  // half.
  EXPECT_GT(left, 280);
  corners = HalfStrong(320, 240);
  CornerSelector().Select(320, 240, 600, 20, {}, &corners);
  const auto right =
      std::count_if(corners.begin(), corners.end(), [](const Corner& c) { return c.x >= 160; });
  EXPECT_GT(right, 0);
}

TEST(CornerSelector, DeferredCornersComeWhenOthersHaveGivenTheirs) {
  const auto left_of = [](int wanted, uint8_t rounds) {
    std::vector<Corner> corners = HalfStrong(320, 240);
    std::vector<uint8_t> rounds_late;
    for (const Corner& corner : corners) rounds_late.push_back(corner.x < 160 ? rounds : 0);
    CornerSelector().Select(320, 240, wanted, 5, rounds_late, &corners);
    EXPECT_EQ(corners.size(), static_cast<size_t>(wanted));
    return std::count_if(corners.begin(), corners.end(), [](const Corner& c) { return c.x < 160; });
  };
  // Of 300 cells of 16 px half are on each side, and each has 16 corners.
  EXPECT_NEAR(static_cast<double>(left_of(300, 0)), 150, 20);
  EXPECT_EQ(left_of(300, 3), 0);
  // Where there are not enough others they come after all: all 2,400 to the right, and 1,600.
  EXPECT_GT(left_of(4000, 3), 1500);
}

TEST(CornerSelector, KeepsTheStrongestOfEachCell) {
  std::vector<Corner> corners;
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 100; ++x) {
      const bool best = x % 10 == 4 && y % 10 == 7;
      corners.push_back(
          {static_cast<uint16_t>(x), static_cast<uint16_t>(y), 0, 0, static_cast<uint8_t>(best ? 60 : 30)});
    }
  }
  CornerSelector().Select(100, 100, 100, 5, {}, &corners);
  ASSERT_EQ(corners.size(), 100u);
  for (const Corner& corner : corners) EXPECT_EQ(corner.score, 60) << corner.x << " " << corner.y;
}

TEST(CornerSelector, TiesGoToTheUpperThenTheLeftCorner) {
  std::vector<Corner> corners;
  for (uint16_t y = 0; y < 20; ++y) {
    for (uint16_t x = 0; x < 20; ++x) corners.push_back({x, y, 0, 0, 50});
  }
  CornerSelector().Select(20, 20, 1, 5, {}, &corners);
  ASSERT_EQ(corners.size(), 1u);
  EXPECT_EQ(corners[0].x, 0);
  EXPECT_EQ(corners[0].y, 0);
}

TEST(CornerSelector, KeepsAllWhenThereAreTooFewAndNoneWhenNoneIsWanted) {
  std::vector<Corner> corners = HalfStrong(40, 40);
  CornerSelector selector;
  selector.Select(40, 40, 1000, 5, {}, &corners);
  EXPECT_EQ(corners.size(), 100u);
  selector.Select(40, 40, 0, 5, {}, &corners);
  EXPECT_TRUE(corners.empty());
}

TEST(CornerSelector, ManyCornersInOneCellAreAllReachable) {
  // More rounds than the selector counts one by one.
  std::vector<Corner> corners;
  for (uint16_t y = 0; y < 30; ++y) {
    for (uint16_t x = 0; x < 30; ++x) corners.push_back({x, y, 0, 0, 50});
  }
  CornerSelector().Select(2000, 2000, 800, 5, {}, &corners);
  EXPECT_EQ(corners.size(), 800u);
}

}  // namespace
}  // namespace dynamic_slam
