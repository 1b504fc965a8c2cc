#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace dynamic_slam {

// The value below which that share of the values lies, 0 to 1; reorders them. Not of none.
inline double Percentile(double share, std::vector<double>* values) {
  const auto at =
      values->begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values->size() - 1));
  std::nth_element(values->begin(), at, values->end());
  return *at;
}

}  // namespace dynamic_slam
