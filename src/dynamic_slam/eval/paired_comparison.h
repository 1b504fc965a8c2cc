#pragma once

#include <optional>
#include <span>

namespace dynamic_slam {

// Errors of two systems on the same input, over the same poses. Infinity: one that failed.
struct ErrorPair {
  double own = 0, other = 0;
};

struct PairedComparison {
  double median_ratio = 1;  // of own over other: 0, infinity where one failed
  int better = 0, worse = 0;
  double p_value = 1;  // how often a fair coin falls so unevenly, or more so: the sign test, two-sided

  bool IsNoChance() const { return p_value < 0.05; }
};

// How systems compare whose errors differ more from input to input than from system to system. Pairs in which
// both failed say nothing. Pairs that are equal are runs that repeated themselves, which the test counts
// once. None: no pair says anything.
std::optional<PairedComparison> ComparePairs(std::span<const ErrorPair> pairs);

}  // namespace dynamic_slam
