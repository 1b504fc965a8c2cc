#include "dynamic_slam/semantics/sanitise.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
const cv::Size kImage(100, 50);

bool AreEqual(const std::vector<Detection>& a, const std::vector<Detection>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Detection& x, const Detection& y) {
    return x.box.x == y.box.x && x.box.y == y.box.y && x.box.width == y.box.width &&
           x.box.height == y.box.height && x.class_id == y.class_id && x.score == y.score;
  });
}

TEST(SanitiseTest, ClipsToTheImage) {
  const auto out = Sanitise({{{-10, -5, 30, 200}, 0, 0.5}}, kImage, 1);
  ASSERT_EQ(out.size(), 1u);
  EXPECT_EQ(out[0].box.x, 0);
  EXPECT_EQ(out[0].box.y, 0);
  EXPECT_EQ(out[0].box.width, 20);
  EXPECT_EQ(out[0].box.height, 50);
}

TEST(SanitiseTest, DropsWhatIsNoBoxOfAClass) {
  const Box good{1, 1, 5, 5};
  EXPECT_THAT(Sanitise({{{kNaN, 1, 5, 5}, 0, 0.5},
                        {{1, 1, kInf, 5}, 0, 0.5},
                        {good, 0, kNaN},
                        {good, -1, 0.5},
                        {good, 2, 0.5},
                        {{1, 1, 0, 5}, 0, 0.5},
                        {{1, 1, 5, -3}, 0, 0.5},
                        {{100, 1, 5, 5}, 0, 0.5},
                        {{-5, 1, 5, 5}, 0, 0.5}},
                       kImage, 2),
              testing::IsEmpty());
  EXPECT_EQ(Sanitise({{good, 1, 0.5}}, kImage, 2).size(), 1u);
}

TEST(SanitiseTest, ScoresAreFrom0To1) {
  const auto out = Sanitise({{{1, 1, 5, 5}, 0, -3}, {{1, 1, 5, 5}, 0, 1.2}}, kImage, 1);
  ASSERT_EQ(out.size(), 2u);
  EXPECT_EQ(out[0].score, 1);
  EXPECT_EQ(out[1].score, 0);
}

TEST(SanitiseTest, KeepsTheBestWhateverTheOrder) {
  Random random(5);
  std::vector<Detection> in;
  for (int i = 0; i < 10000; ++i) {
    in.push_back({{random.Uniform(-50, 100), random.Uniform(-50, 50), random.Uniform(1, 50), 30},
                  static_cast<int>(random.Index(3)),
                  0.01 * random.Index(100)});
  }
  const auto out = Sanitise(in, kImage, 3);
  EXPECT_EQ(out.size(), kMaxDetections);
  EXPECT_TRUE(std::is_sorted(out.begin(), out.end(),
                             [](const Detection& a, const Detection& b) { return a.score > b.score; }));
  for (size_t i = in.size(); i > 1; --i) std::swap(in[i - 1], in[random.Index(static_cast<uint32_t>(i))]);
  EXPECT_TRUE(AreEqual(Sanitise(in, kImage, 3), out));
  EXPECT_TRUE(AreEqual(Sanitise(out, kImage, 3), out)) << "nothing is left to do";
}

TEST(SuppressNonMaximaTest, KeepsTheBestOfWhatOverlaps) {
  // IoU of neighbours: 8 of 12, 0.667; of the first and the third: 6 of 14, 0.429.
  const std::vector<Detection> in = {
      {{4, 0, 10, 1}, 0, 0.7}, {{2, 0, 10, 1}, 0, 0.8}, {{0, 0, 10, 1}, 0, 0.9}};
  const auto out = SuppressNonMaxima(in, 0.45);
  ASSERT_EQ(out.size(), 2u) << "the second covers the third, but is not kept itself";
  EXPECT_EQ(out[0].score, 0.9);
  EXPECT_EQ(out[1].score, 0.7);
  EXPECT_EQ(SuppressNonMaxima(in, 0.7).size(), 3u);
  EXPECT_EQ(SuppressNonMaxima(in, 0.4).size(), 1u);
}

TEST(SuppressNonMaximaTest, ClassesDoNotCoverEachOther) {
  EXPECT_EQ(SuppressNonMaxima({{{0, 0, 10, 10}, 0, 0.9}, {{0, 0, 10, 10}, 1, 0.8}}, 0.45).size(), 2u);
}

TEST(SuppressNonMaximaTest, NoTwoOfOneClassOverlapAndEachLeftOutIsCovered) {
  Random random(9);
  for (int round = 0; round < 50; ++round) {
    std::vector<Detection> in;
    for (int i = 0; i < 60; ++i) {
      in.push_back(
          {{random.Uniform(0, 60), random.Uniform(0, 60), random.Uniform(5, 40), random.Uniform(5, 40)},
           static_cast<int>(random.Index(2)),
           random.Uniform()});
    }
    const auto out = SuppressNonMaxima(in, 0.4);
    for (const Detection& d : in) {
      int same = 0, covering = 0;
      for (const Detection& kept : out) {
        if (kept.class_id != d.class_id) continue;
        same += kept.score == d.score ? 1 : 0;
        covering += kept.score > d.score && IoU(kept.box, d.box) > 0.4 ? 1 : 0;
      }
      EXPECT_EQ(same == 1, covering == 0);
    }
  }
}

}  // namespace
}  // namespace dynamic_slam
