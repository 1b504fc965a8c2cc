#include "dynamic_slam/eval/paired_comparison.h"

#include <limits>
#include <vector>

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

constexpr double kFailed = std::numeric_limits<double>::infinity();

// `better` pairs of ratio 0.5 and `worse` of 2, no two alike.
std::vector<ErrorPair> Pairs(int better, int worse) {
  std::vector<ErrorPair> pairs;
  for (int i = 0; i < better; ++i) pairs.push_back({1.0 + i, 2.0 + 2 * i});
  for (int i = 0; i < worse; ++i) pairs.push_back({2.0 + 2 * i, 1.0 + i});
  return pairs;
}

TEST(PairedComparison, SignTestHasKnownAnswers) {
  // 2 / 2^5; 2 (1 + 10 + 45) / 2^10; half of all throws on each side.
  EXPECT_NEAR(ComparePairs(Pairs(5, 0))->p_value, 0.0625, 1e-12);
  EXPECT_NEAR(ComparePairs(Pairs(2, 8))->p_value, 0.109375, 1e-12);
  EXPECT_EQ(ComparePairs(Pairs(4, 4))->p_value, 1);
  EXPECT_FALSE(ComparePairs(Pairs(5, 0))->IsNoChance());
  EXPECT_TRUE(ComparePairs(Pairs(0, 6))->IsNoChance()) << "2 / 2^6";
}

TEST(PairedComparison, RatiosAreOfEachPair) {
  // Their medians are 2 and 4; pair by pair neither is better.
  const std::vector<ErrorPair> pairs = {{1, 1}, {2, 4}, {9, 5}, {4, 2}, {1.5, 7}};
  const std::optional<PairedComparison> comparison = ComparePairs(pairs);
  ASSERT_TRUE(comparison.has_value());
  EXPECT_EQ(comparison->median_ratio, 1);
  EXPECT_EQ(comparison->better, 2);
  EXPECT_EQ(comparison->worse, 2) << "equal errors are neither";
}

TEST(PairedComparison, FailuresAreWorstAndTwoSayNothing) {
  const std::vector<ErrorPair> pairs = {{kFailed, 1}, {kFailed, 2}, {1, kFailed}, {kFailed, kFailed}};
  const std::optional<PairedComparison> comparison = ComparePairs(pairs);
  ASSERT_TRUE(comparison.has_value());
  EXPECT_EQ(comparison->median_ratio, kFailed);
  EXPECT_EQ(comparison->better, 1);
  EXPECT_EQ(comparison->worse, 2);
  EXPECT_FALSE(ComparePairs(std::vector<ErrorPair>{{kFailed, kFailed}}).has_value());
  EXPECT_FALSE(ComparePairs({}).has_value());
}

TEST(PairedComparison, RunsThatRepeatThemselvesAreNoEvidence) {
  const std::vector<ErrorPair> pairs(20, {1, 2});
  const std::optional<PairedComparison> comparison = ComparePairs(pairs);
  ASSERT_TRUE(comparison.has_value());
  EXPECT_EQ(comparison->median_ratio, 0.5);
  EXPECT_EQ(comparison->better, 1);
  EXPECT_EQ(comparison->p_value, 1);
}

}  // namespace
}  // namespace dynamic_slam
