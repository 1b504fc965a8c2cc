#include "dynamic_slam/eval/paired_comparison.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>
#include <vector>

#include "dynamic_slam/eval/metrics.h"

namespace dynamic_slam {
namespace {

// P of at most `fewest` heads among n throws.
double BinomialTail(int fewest, int n) {
  double sum = 0;
  for (int k = 0; k <= fewest; ++k)
    sum += std::exp(std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1) - n * std::log(2.0));
  return sum;
}

}  // namespace

std::optional<PairedComparison> ComparePairs(std::span<const ErrorPair> pairs) {
  std::vector<double> ratios;
  std::set<std::pair<double, double>> different;
  for (const ErrorPair& pair : pairs) {
    if (pair.own == pair.other) {
      if (std::isfinite(pair.own)) ratios.push_back(1);
      continue;
    }
    ratios.push_back(pair.own / pair.other);
    different.insert({pair.own, pair.other});
  }
  if (ratios.empty()) return std::nullopt;
  PairedComparison comparison;
  for (const auto& [own, other] : different) ++(own < other ? comparison.better : comparison.worse);
  comparison.median_ratio = Summarise(std::move(ratios)).median;
  const int fewest = std::min(comparison.better, comparison.worse);
  comparison.p_value = std::min(1.0, 2 * BinomialTail(fewest, comparison.better + comparison.worse));
  return comparison;
}

}  // namespace dynamic_slam
