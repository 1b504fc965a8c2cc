#include "dynamic_slam/features/place_index.h"

#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

using testing::IsEmpty;

// A place is a set of points; an image of it shows most of them, and of two images of a point an eighth of
// the bits differ.
class Places {
 public:
  explicit Places(int points = 400) : points_(points) {}

  FeatureSet Image(uint64_t place, uint64_t view, double share = 0.7) {
    Random points(place), noise(1000 * view + place + 1);
    FeatureSet image;
    for (int i = 0; i < points_; ++i) {
      Descriptor descriptor{points.Next(), points.Next(), points.Next(), points.Next()};
      if (noise.Uniform() >= share) {
        descriptor = {noise.Next(), noise.Next(), noise.Next(), noise.Next()};
      }
      for (int bit = 0; bit < 256; ++bit) {
        if (noise.Uniform() < 0.065) descriptor[static_cast<size_t>(bit / 64)] ^= 1ULL << (bit % 64);
      }
      Keypoint keypoint;
      keypoint.response = static_cast<float>(noise.Uniform());
      image.keypoints.push_back(keypoint);
      image.descriptors.push_back(descriptor);
    }
    return image;
  }
  std::vector<uint64_t> Words(uint64_t place, uint64_t view) { return PlaceWords(Image(place, view), {}, 0); }

 private:
  int points_;
};

TEST(PlaceIndexTest, StartsEmptyAndSaysNothing) {
  const PlaceIndex index;
  EXPECT_THAT(index.Query(Places().Words(1, 0)), IsEmpty());
  EXPECT_EQ(index.size(), 0u);
}

TEST(PlaceIndexTest, KnowsAPlaceAgainAmongAHundredOthers) {
  Places places;
  PlaceIndex index;
  for (uint32_t place = 0; place < 100; ++place) index.Add(KeyframeId(place), places.Words(place, 0));
  for (uint32_t place = 0; place < 100; ++place) {
    const std::vector<PlaceMatch> found = index.Query(places.Words(place, 1));
    ASSERT_GE(found.size(), 1u);
    EXPECT_EQ(found[0].keyframe, KeyframeId(place));
    EXPECT_TRUE(found.size() == 1 || 3 * found[1].score < found[0].score);
  }
}

TEST(PlaceIndexTest, AnImageIsMostLikeItself) {
  Places places;
  PlaceIndex index;
  index.Add(KeyframeId(0), places.Words(1, 0));
  index.Add(KeyframeId(1), places.Words(1, 1));
  const std::vector<uint64_t> words = places.Words(1, 0);
  const std::vector<PlaceMatch> found = index.Query(words);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].keyframe, KeyframeId(0));
  EXPECT_EQ(found[0].words, static_cast<int>(words.size()));
  EXPECT_LE(found[0].score, 1.0);
  EXPECT_GT(found[0].score, found[1].score);
  EXPECT_GT(found[1].score, 0.0);
}

TEST(PlaceIndexTest, WordsThatAllHaveTellLittle) {
  Places places;
  PlaceIndex index;
  std::vector<uint64_t> common = places.Words(1, 0), rare = places.Words(2, 0);
  common.resize(100);
  rare.resize(100);
  std::vector<uint64_t> both = common;
  both.insert(both.end(), rare.begin(), rare.end());
  for (uint32_t i = 0; i < 20; ++i) index.Add(KeyframeId(i), common);
  index.Add(KeyframeId(20), rare);
  const std::vector<PlaceMatch> found = index.Query(both);
  ASSERT_EQ(found.size(), 21u);
  EXPECT_EQ(found[0].keyframe, KeyframeId(20));
  EXPECT_GT(found[0].score, 10 * found[1].score);
}

TEST(PlaceIndexTest, TheErasedIsGoneAndTheOrderOfAdditionDoesNotMatter) {
  Places places;
  PlaceIndex all, some;
  for (uint32_t place = 0; place < 10; ++place) all.Add(KeyframeId(place), places.Words(place, 0));
  for (uint32_t place = 10; place-- > 0;) {
    if (place != 3) some.Add(KeyframeId(place), places.Words(place, 0));
  }
  all.Erase(KeyframeId(3));
  all.Erase(KeyframeId(3));
  all.Erase(KeyframeId(99));
  EXPECT_EQ(all.size(), 9u);
  for (uint64_t place = 0; place < 10; ++place) {
    const auto a = all.Query(places.Words(place, 1)), b = some.Query(places.Words(place, 1));
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a[i].keyframe, b[i].keyframe);
      EXPECT_EQ(a[i].score, b[i].score);
      EXPECT_NE(a[i].keyframe, KeyframeId(3));
    }
  }
  all.Clear();
  EXPECT_THAT(all.Query(places.Words(1, 0)), IsEmpty());
}

TEST(PlaceIndexTest, WhatMovesTakesNoPart) {
  Places places;
  const FeatureSet image = places.Image(1, 0);
  std::vector<float> static_probability(image.size(), 0.4f);
  EXPECT_THAT(PlaceWords(image, static_probability, 0.5f), IsEmpty());
  for (size_t i = 0; i < 100; ++i) static_probability[i] = 0.5f;
  EXPECT_EQ(PlaceWords(image, static_probability, 0.5f).size(), 100u);
}

TEST(PlaceIndexTest, TheStrongestKeypointsAreTaken) {
  FeatureSet image = Places(1000).Image(1, 0);
  std::set<uint64_t> strong;
  for (size_t i = 0; i < image.size(); ++i) {
    image.keypoints[i].response = static_cast<float>((i * 7919) % 1000);
    if (image.keypoints[i].response >= 1000 - PlaceIndex::kMaxWords) {
      strong.insert(image.descriptors[i][0]);
    }
  }
  const std::vector<uint64_t> words = PlaceWords(image, {}, 0);
  EXPECT_EQ(words.size(), PlaceIndex::kMaxWords);
  for (const uint64_t word : words) EXPECT_TRUE(strong.contains(word));
}

TEST(PlaceIndexTest, AKeyframeTakesLessThanTwoKilobytes) {
  Places places(2000);
  PlaceIndex index;
  for (uint32_t place = 0; place < 64; ++place) index.Add(KeyframeId(place), places.Words(place, 0));
  EXPECT_LT(index.MemoryBytes(), 64u * 2000u);
}

}  // namespace
}  // namespace dynamic_slam
