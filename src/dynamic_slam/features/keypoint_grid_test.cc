#include "dynamic_slam/features/keypoint_grid.h"

#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/segment.h"

namespace dynamic_slam {
namespace {

constexpr int kOctaves = 8;
constexpr std::array<double, 4> kBounds = {-12.5, -7.25, 652.75, 491};

FeatureSet RandomFeatures(int count, uint64_t seed) {
  Random random(seed);
  FeatureSet features;
  for (int i = 0; i < count; ++i) {
    Keypoint keypoint;
    // A little beyond the bounds too.
    keypoint.x = static_cast<float>(random.Uniform(kBounds[0] - 5, kBounds[2] + 5));
    keypoint.y = static_cast<float>(random.Uniform(kBounds[1] - 5, kBounds[3] + 5));
    keypoint.octave = static_cast<int>(random.Index(kOctaves));
    features.keypoints.push_back(keypoint);
    features.descriptors.emplace_back();
  }
  return features;
}

std::vector<uint32_t> Query(const KeypointGrid& grid, float x, float y, float radius_px, int min_octave = 0,
                            int max_octave = kOctaves - 1) {
  std::vector<uint32_t> found;
  grid.ForEachInWindow(x, y, radius_px, min_octave, max_octave,
                       [&](uint32_t index) { found.push_back(index); });
  return found;
}

TEST(KeypointGrid, EachKeypointIsInOneCellWithThoseAroundIt) {
  const FeatureSet features = RandomFeatures(1500, 5);
  KeypointGrid grid;
  grid.Build(features, kBounds);
  std::vector<int> cell_of(features.size(), -1);
  int cells = 0;
  grid.ForEachCell([&](std::span<const uint32_t> keypoints) {
    ASSERT_FALSE(keypoints.empty());
    for (const uint32_t i : keypoints) {
      EXPECT_EQ(cell_of[i], -1);
      cell_of[i] = cells;
    }
    ++cells;
  });
  const auto inside = [&](const Keypoint& k) {
    return k.x > kBounds[0] && k.x < kBounds[2] && k.y > kBounds[1] && k.y < kBounds[3];
  };
  const auto column = [&](float x) { return std::floor((x - kBounds[0]) / KeypointGrid::kCellSizePx); };
  const auto row = [&](float y) { return std::floor((y - kBounds[1]) / KeypointGrid::kCellSizePx); };
  for (size_t i = 0; i < features.size(); ++i) {
    ASSERT_GE(cell_of[i], 0);
    for (size_t j = 0; j < i; ++j) {
      const Keypoint &a = features.keypoints[i], &b = features.keypoints[j];
      if (!inside(a) || !inside(b)) continue;  // in the nearest cell of the border
      EXPECT_EQ(cell_of[i] == cell_of[j], column(a.x) == column(b.x) && row(a.y) == row(b.y));
    }
  }
}

TEST(KeypointGrid, FindsExactlyWhatBruteForceFinds) {
  const FeatureSet features = RandomFeatures(1500, 3);
  KeypointGrid grid;
  grid.Build(features, kBounds);
  EXPECT_EQ(grid.size(), features.size());
  Random random(4);
  size_t total = 0;
  for (int query = 0; query < 500; ++query) {
    const float x = static_cast<float>(random.Uniform(-60, 700));
    const float y = static_cast<float>(random.Uniform(-60, 540));
    // The largest windows hold more keypoints than are collected at a time.
    const float radius_px = static_cast<float>(random.Uniform(0, query % 10 == 0 ? 400 : 80));
    const int min_octave = static_cast<int>(random.Index(kOctaves)) - 1, max_octave = min_octave + query % 9;
    std::vector<uint32_t> expected;
    for (uint32_t i = 0; i < features.size(); ++i) {
      const float dx = features.keypoints[i].x - x, dy = features.keypoints[i].y - y;
      const int octave = features.keypoints[i].octave;
      if (octave < min_octave || octave > max_octave) continue;
      if (dx * dx + dy * dy <= radius_px * radius_px) expected.push_back(i);
    }
    EXPECT_THAT(Query(grid, x, y, radius_px, min_octave, max_octave),
                testing::UnorderedElementsAreArray(expected));
    total += expected.size();
  }
  EXPECT_GT(total, 1000u);
}

TEST(KeypointGrid, FindsWhatLiesAlongALine) {
  const FeatureSet features = RandomFeatures(1500, 5);
  KeypointGrid grid;
  grid.Build(features, kBounds);
  Random random(6);
  const auto point = [&random] {
    return Eigen::Vector2f(static_cast<float>(random.Uniform(-60, 700)),
                           static_cast<float>(random.Uniform(-60, 540)));
  };
  size_t total = 0;
  for (int query = 0; query < 500; ++query) {
    const Eigen::Vector2f a = point(), b = query % 10 == 0 ? a : point();
    const float radius_px = static_cast<float>(random.Uniform(0, 40));
    std::vector<uint32_t> found, near, beyond;
    grid.ForEachAlong(a, b, radius_px, 1, 2, [&](uint32_t index) { found.push_back(index); });
    for (uint32_t i = 0; i < features.size(); ++i) {
      const Keypoint& keypoint = features.keypoints[i];
      const double distance = DistanceToSegment({keypoint.x, keypoint.y}, a.cast<double>(), b.cast<double>());
      // Numbers of less precision may tell otherwise what lies just on the border.
      if (keypoint.octave < 1 || keypoint.octave > 2 || distance > radius_px + 1e-3) {
        beyond.push_back(i);
      } else if (distance < radius_px - 1e-3) {
        near.push_back(i);
      }
    }
    EXPECT_THAT(found, testing::IsSupersetOf(near));
    for (const uint32_t i : beyond) EXPECT_THAT(found, testing::Not(testing::Contains(i)));
    total += near.size();
  }
  EXPECT_GT(total, 1000u);
}

TEST(KeypointGrid, TheOrderIsByCellThenByIndex) {
  FeatureSet features;
  for (const auto& [x, y] : {std::pair{40.0f, 40.0f}, {3.0f, 3.0f}, {41.0f, 39.0f}, {5.0f, 2.0f}}) {
    Keypoint keypoint;
    keypoint.x = x;
    keypoint.y = y;
    features.keypoints.push_back(keypoint);
    features.descriptors.emplace_back();
  }
  KeypointGrid grid;
  grid.Build(features, {0, 0, 100, 100});
  EXPECT_THAT(Query(grid, 20, 20, 100), testing::ElementsAre(1, 3, 0, 2));
}

TEST(KeypointGrid, TheRadiusIsInclusive) {
  FeatureSet features;
  features.keypoints.resize(1);
  features.descriptors.resize(1);
  features.keypoints[0].x = 30;
  features.keypoints[0].y = 10;
  KeypointGrid grid;
  grid.Build(features, {0, 0, 100, 100});
  EXPECT_THAT(Query(grid, 20, 10, 10), testing::ElementsAre(0));
  EXPECT_THAT(Query(grid, 20, 10, 9.999f), testing::IsEmpty());
  EXPECT_THAT(Query(grid, 30, 10, 0), testing::ElementsAre(0));
}

TEST(KeypointGrid, OddQueriesFindNothing) {
  KeypointGrid grid;
  EXPECT_THAT(Query(grid, 0, 0, 10), testing::IsEmpty());  // never built
  grid.Build(RandomFeatures(100, 5), kBounds);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(Query(grid, 0, 0, -1), testing::IsEmpty());
  EXPECT_THAT(Query(grid, nan, 0, 10), testing::IsEmpty());
  EXPECT_THAT(Query(grid, 0, 0, nan), testing::IsEmpty());
  EXPECT_THAT(Query(grid, 1e30f, -1e30f, 10), testing::IsEmpty());
  EXPECT_EQ(Query(grid, 0, 0, 1e9f).size(), 100u);
  const auto count_along = [&grid](const Eigen::Vector2f& a, const Eigen::Vector2f& b, float radius_px) {
    int count = 0;
    grid.ForEachAlong(a, b, radius_px, 0, 7, [&](uint32_t) { ++count; });
    return count;
  };
  EXPECT_EQ(count_along({0, 0}, {600, 400}, 1e9f), 100);
  EXPECT_EQ(count_along({0, 0}, {600, 400}, -1), 0);
  EXPECT_EQ(count_along({0, 0}, {600, 400}, nan), 0);
  EXPECT_EQ(count_along({nan, 0}, {600, 400}, 50), 0);
  EXPECT_EQ(count_along({0, 0}, {600, nan}, 50), 0);
  grid.Build(FeatureSet(), kBounds);
  EXPECT_THAT(Query(grid, 0, 0, 1e9f), testing::IsEmpty());
}

TEST(KeypointGrid, EmptyBoundsAreABug) {
  KeypointGrid grid;
  EXPECT_THROW(grid.Build(FeatureSet(), {0, 0, 0, 10}), InternalError);
}

}  // namespace
}  // namespace dynamic_slam
