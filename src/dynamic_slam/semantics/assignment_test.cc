#include "dynamic_slam/semantics/assignment.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

using testing::ElementsAre;

constexpr double kNever = std::numeric_limits<double>::infinity();

struct Total {
  int pairs = 0;
  double cost = 0;
  bool IsBetterThan(const Total& other) const {
    return pairs > other.pairs || (pairs == other.pairs && cost < other.cost);
  }
};

// The best total over all ways to give each row a column of its own or none.
Total BruteForce(const Eigen::MatrixXd& costs) {
  Total best;
  std::vector<bool> is_taken(costs.cols(), false);
  std::function<void(int, Total)> place = [&](int row, Total total) {
    if (row == costs.rows()) {
      if (total.IsBetterThan(best)) best = total;
      return;
    }
    place(row + 1, total);
    for (int c = 0; c < costs.cols(); ++c) {
      if (is_taken[c] || !std::isfinite(costs(row, c))) continue;
      is_taken[c] = true;
      place(row + 1, {total.pairs + 1, total.cost + costs(row, c)});
      is_taken[c] = false;
    }
  };
  place(0, {});
  return best;
}

TEST(CheapestPairs, PrefersTheSumToTheCheapestPair) {
  Eigen::MatrixXd costs(2, 2);
  costs << 1, 2, 2, 9;  // greedy would take 1 + 9
  EXPECT_THAT(CheapestPairs(costs), ElementsAre(1, 0));
}

TEST(CheapestPairs, MorePairsBeforeCheaperOnes) {
  Eigen::MatrixXd costs(2, 2);
  costs << 0, 100, kNever, 0;
  EXPECT_THAT(CheapestPairs(costs), ElementsAre(0, 1));
  costs << 0, 100, 0, kNever;
  EXPECT_THAT(CheapestPairs(costs), ElementsAre(1, 0));
}

TEST(CheapestPairs, NothingToPair) {
  EXPECT_TRUE(CheapestPairs(Eigen::MatrixXd(0, 3)).empty());
  EXPECT_THAT(CheapestPairs(Eigen::MatrixXd(2, 0)), ElementsAre(-1, -1));
  EXPECT_THAT(CheapestPairs(Eigen::MatrixXd::Constant(2, 3, kNever)), ElementsAre(-1, -1));
  EXPECT_THROW(CheapestPairs(Eigen::MatrixXd::Constant(1, 1, std::nan(""))), InternalError);
}

TEST(CheapestPairs, EqualsBruteForce) {
  Random random(7);
  for (int trial = 0; trial < 2000; ++trial) {
    const int rows = 1 + random.Index(5);
    const int columns = 1 + random.Index(5);
    const double share_forbidden = random.Uniform();
    Eigen::MatrixXd costs(rows, columns);
    for (double& cost : costs.reshaped()) {
      // Whole numbers make ties.
      cost = random.Uniform() < share_forbidden ? kNever
             : trial % 2 == 0                   ? random.Index(4)
                                                : random.Uniform(-5, 5);
    }
    Total found;
    std::vector<bool> is_taken(columns, false);
    const std::vector<int> column_of = CheapestPairs(costs);
    ASSERT_EQ(column_of.size(), static_cast<size_t>(rows));
    for (int row = 0; row < rows; ++row) {
      if (column_of[row] < 0) continue;
      ASSERT_FALSE(is_taken[column_of[row]]) << costs;
      is_taken[column_of[row]] = true;
      ++found.pairs;
      found.cost += costs(row, column_of[row]);
    }
    const Total best = BruteForce(costs);
    EXPECT_EQ(found.pairs, best.pairs) << costs;
    EXPECT_NEAR(found.cost, best.cost, 1e-9) << costs;
  }
}

}  // namespace
}  // namespace dynamic_slam
