#include "dynamic_slam/features/matcher.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr float kPi = std::numbers::pi_v<float>;

Descriptor RandomDescriptor(Random& random) {
  return {random.Next(), random.Next(), random.Next(), random.Next()};
}

// A descriptor with the first `count` bits turned over.
Descriptor Flip(Descriptor descriptor, int count) {
  for (int i = 0; i < count; ++i) descriptor[static_cast<size_t>(i / 64)] ^= 1ULL << (i % 64);
  return descriptor;
}

FeatureSet MakeFeatures(const std::vector<Descriptor>& descriptors) {
  FeatureSet features;
  features.descriptors = descriptors;
  features.keypoints.resize(descriptors.size());
  return features;
}

std::vector<uint32_t> Indices(uint32_t count) {
  std::vector<uint32_t> indices(count);
  std::iota(indices.begin(), indices.end(), 0u);
  return indices;
}

TEST(FindInWindowTest, FindsWhatASearchThroughAllFinds) {
  Random random(3);
  FeatureSet features;
  std::vector<uint8_t> taken;
  for (int i = 0; i < 600; ++i) {
    Keypoint keypoint;
    keypoint.x = static_cast<float>(random.Uniform(0, 640));
    keypoint.y = static_cast<float>(random.Uniform(0, 480));
    keypoint.octave = static_cast<int>(random.Index(8));
    features.keypoints.push_back(keypoint);
    features.descriptors.push_back(RandomDescriptor(random));
    taken.push_back(random.Index(4) == 0);
  }
  KeypointGrid grid;
  grid.Build(features, {0, 0, 640, 480});
  for (int query = 0; query < 300; ++query) {
    const SearchWindow window{static_cast<float>(random.Uniform(-20, 660)),
                              static_cast<float>(random.Uniform(-20, 500)),
                              static_cast<float>(random.Uniform(0, 120)), 1, 5};
    const Descriptor descriptor = RandomDescriptor(random);
    std::vector<int> distances;
    for (size_t i = 0; i < features.size(); ++i) {
      const Keypoint& keypoint = features.keypoints[i];
      if (std::hypot(keypoint.x - window.x, keypoint.y - window.y) > window.radius_px) continue;
      if (keypoint.octave < 1 || keypoint.octave > 5 || taken[i] != 0) continue;
      distances.push_back(HammingDistance(descriptor, features.descriptors[i]));
    }
    std::sort(distances.begin(), distances.end());
    const WindowMatch match = FindInWindow(features, grid, window, descriptor, taken);
    ASSERT_EQ(match.Found(), !distances.empty());
    if (!match.Found()) continue;
    EXPECT_EQ(match.distance, distances[0]);
    EXPECT_EQ(match.distance, HammingDistance(descriptor, features.descriptors[match.keypoint]));
    EXPECT_EQ(match.octave, features.keypoints[match.keypoint].octave);
    EXPECT_EQ(match.second_distance, distances.size() > 1 ? distances[1] : 257);
    EXPECT_EQ(taken[match.keypoint], 0);
  }
}

TEST(MatchMutualTest, BothMustPreferEachOther) {
  Random random(5);
  const Descriptor a = RandomDescriptor(random), b = RandomDescriptor(random), c = RandomDescriptor(random);
  const FeatureSet first = MakeFeatures({a, b, Flip(a, 9)});
  const FeatureSet second = MakeFeatures({c, Flip(b, 20), Flip(a, 4)});
  const std::vector<uint32_t> all = Indices(3);
  const auto matches = MatchMutual(first, all, second, all, 64, 1.0);
  // Flip(a, 9) is 5 bits from Flip(a, 4), but a is nearer.
  ASSERT_EQ(matches.size(), 2u);
  EXPECT_EQ(matches[0].first, 0u);
  EXPECT_EQ(matches[0].second, 2u);
  EXPECT_EQ(matches[0].distance, 4);
  EXPECT_EQ(matches[1].first, 1u);
  EXPECT_EQ(matches[1].second, 1u);
  EXPECT_EQ(matches[1].distance, 20);
}

TEST(MatchMutualTest, LimitsHold) {
  Random random(6);
  const Descriptor a = RandomDescriptor(random);
  const FeatureSet first = MakeFeatures({a});
  const FeatureSet second = MakeFeatures({Flip(a, 30), Flip(a, 40)});
  const std::vector<uint32_t> one = Indices(1), two = Indices(2);
  EXPECT_EQ(MatchMutual(first, one, second, two, 30, 0.8).size(), 1u);
  EXPECT_THAT(MatchMutual(first, one, second, two, 29, 0.8), IsEmpty()) << "too far";
  EXPECT_THAT(MatchMutual(first, one, second, two, 30, 0.75), IsEmpty()) << "30 of 40 is not below the ratio";
  EXPECT_THAT(MatchMutual(first, {}, second, two, 256, 1.0), IsEmpty());
}

TEST(MatchMutualTest, OnlyListedKeypointsMatch) {
  Random random(7);
  const Descriptor a = RandomDescriptor(random);
  const FeatureSet first = MakeFeatures({RandomDescriptor(random), a});
  const FeatureSet second = MakeFeatures({a, Flip(a, 10)});
  const std::vector<uint32_t> last{1};
  const auto matches = MatchMutual(first, last, second, last, 64, 1.0);
  ASSERT_EQ(matches.size(), 1u);
  EXPECT_EQ(matches[0].first, 1u);
  EXPECT_EQ(matches[0].second, 1u) << "keypoint 0 would be nearer";
}

TEST(RotationConsistencyTest, KeepsTheRotationOfTheMost) {
  RotationConsistency consistency;
  for (const float turn : {1.0f, 1.02f, 0.95f, 1.0f - 2 * kPi, 2.5f, -1.0f})
    consistency.Add(0.3f + turn, 0.3f);
  EXPECT_THAT(consistency.Judge(), ElementsAre(1, 1, 1, 1, 0, 0));
  consistency.Clear();
  EXPECT_THAT(consistency.Judge(), IsEmpty());
}

TEST(RotationConsistencyTest, NoTurnIsNotSplitAtZero) {
  RotationConsistency consistency;
  for (const float turn : {0.01f, -0.01f, 0.02f, -0.02f, kPi}) consistency.Add(turn, 0);
  EXPECT_THAT(consistency.Judge(), ElementsAre(1, 1, 1, 1, 0));
}

}  // namespace
}  // namespace dynamic_slam
