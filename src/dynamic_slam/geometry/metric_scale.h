#pragma once

#include <string>

namespace dynamic_slam {

// How long a map's unit of length is.
struct MetricScale {
  double metres_per_unit = 1;
  double relative_error = 0;  // standard deviation, as a share of metres_per_unit
  std::string from;           // what says so
};

}  // namespace dynamic_slam
