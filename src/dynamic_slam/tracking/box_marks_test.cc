#include "dynamic_slam/tracking/box_marks.h"

#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

Keypoint KeypointAt(double x, double y, int octave) {
  Keypoint keypoint;
  keypoint.raw_x = static_cast<float>(x);
  keypoint.raw_y = static_cast<float>(y);
  keypoint.octave = octave;
  return keypoint;
}

FeatureSet SetOf(const std::vector<Keypoint>& keypoints) {
  FeatureSet features;
  for (const Keypoint& keypoint : keypoints) {
    features.keypoints.push_back(keypoint);
    features.descriptors.emplace_back();
  }
  return features;
}

TEST(BoxMarks, AreOnThoseThatTheBoxContains) {
  Random random(2);
  FeatureSet features;
  for (int i = 0; i < 1000; ++i) {
    features.keypoints.push_back(
        KeypointAt(random.Uniform(0, 640), random.Uniform(0, 480), i < 700 ? 0 : i % 3));
  }
  features.descriptors.resize(features.keypoints.size());
  const std::array<double, 3> more_px = {3, 3.6, 4.32};
  const Box first{100.3, 50.7, 200, 300}, second{250, 0, 390, 480};
  BoxMarks marks;
  marks.Begin(features);
  marks.Mark(first, 7.1, more_px, 1);
  marks.Mark(second, 0, {}, 6);
  int in_first = 0, in_second = 0;
  for (size_t i = 0; i < features.size(); ++i) {
    const Keypoint& keypoint = features.keypoints[i];
    const bool is_in_first = first.Contains(keypoint.raw_x, keypoint.raw_y, 7.1 + more_px[keypoint.octave]);
    const bool is_in_second = second.Contains(keypoint.raw_x, keypoint.raw_y);
    EXPECT_EQ(marks.bits()[i], (is_in_first ? 1u : 0u) | (is_in_second ? 6u : 0u)) << i;
    in_first += is_in_first;
    in_second += is_in_second;
  }
  EXPECT_GT(in_first, 100);
  EXPECT_GT(in_second, 100);
}

TEST(BoxMarks, KnowABorderAsExactlyAsTheBoxDoes) {
  // 0.1 is no float: the nearest one is more, that of 0.3 is more too, that of 0.7 is less.
  const Box box{0.1, 0.3, 100.6, 100.4};
  std::vector<Keypoint> keypoints;
  for (const double x : {0.1, 0.1000000001, 100.7}) {
    for (const float near : {-1.0f, 0.0f, 1.0f}) {
      Keypoint keypoint = KeypointAt(x, 50, 0);
      keypoint.raw_x = std::nextafter(keypoint.raw_x, keypoint.raw_x + near);
      keypoints.push_back(keypoint);
    }
  }
  const FeatureSet features = SetOf(keypoints);
  BoxMarks marks;
  marks.Begin(features);
  marks.Mark(box, 0, {}, 1);
  for (size_t i = 0; i < features.size(); ++i) {
    EXPECT_EQ(marks.bits()[i] != 0, box.Contains(keypoints[i].raw_x, keypoints[i].raw_y)) << i;
  }
  EXPECT_EQ(marks.bits()[0], 0u);  // below
  EXPECT_EQ(marks.bits()[1], 1u);
}

TEST(BoxMarks, BeginAnew) {
  const FeatureSet features = SetOf({KeypointAt(10, 10, 0), KeypointAt(90, 10, 0)});
  BoxMarks marks;
  marks.Begin(features);
  marks.Mark({0, 0, 100, 100}, 0, {}, 1);
  marks.Begin(features);
  marks.Mark({0, 0, 50, 50}, 0, {}, 2);
  EXPECT_EQ(marks.bits()[0], 2u);
  EXPECT_EQ(marks.bits()[1], 0u);
  marks.Begin({});
  marks.Mark({0, 0, 50, 50}, 0, {}, 2);
  EXPECT_TRUE(marks.bits().empty());
}

}  // namespace
}  // namespace dynamic_slam
