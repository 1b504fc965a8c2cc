#include "dynamic_slam/report/truth_comparison.h"

#include <cmath>

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

// A circle of 1 m in ten seconds, and of the estimate some frames are 0.1 m too high.
Trajectory CircleWithBumps(int first_high, int end_high) {
  Trajectory path;
  for (int i = 0; i < 100; ++i) {
    const double angle = 0.0628 * i;
    const double height = i >= first_high && i < end_high ? 0.1 : 0;
    path.push_back(
        {0.1 * i, Rigid3(Eigen::Quaterniond::Identity(), {std::cos(angle), std::sin(angle), height})});
  }
  return path;
}

TEST(TruthComparison, TheErrorOfFramesTrackedLiveIsTheirsAlone) {
  const Trajectory truth = CircleWithBumps(0, 0), estimate = CircleWithBumps(90, 100);
  const Trajectory live(estimate.begin(), estimate.begin() + 90);
  EXPECT_GT(CompareWithTruth(truth, estimate).ape.translation_m.rmse, 0.02);
  EXPECT_EQ(DescribeLiveApe(truth, estimate, live), "0.0000 m over the frames tracked live");
  const Trajectory with_some(estimate.begin(), estimate.begin() + 95);
  EXPECT_NE(DescribeLiveApe(truth, estimate, with_some), "0.0000 m over the frames tracked live");
}

TEST(TruthComparison, NothingIsSaidWhereAllFramesWereTrackedLiveOrTooFew) {
  const Trajectory truth = CircleWithBumps(0, 0), estimate = CircleWithBumps(90, 100);
  EXPECT_FALSE(DescribeLiveApe(truth, estimate, estimate).has_value());
  EXPECT_FALSE(DescribeLiveApe(truth, estimate, {}).has_value());
  const Trajectory two(estimate.begin(), estimate.begin() + 2);
  EXPECT_FALSE(DescribeLiveApe(truth, estimate, two).has_value());
}

}  // namespace
}  // namespace dynamic_slam
