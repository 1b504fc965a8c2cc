#pragma once

#include <vector>

#include <Eigen/Core>

namespace dynamic_slam {

// The cheapest one-to-one pairs of rows and columns: as many pairs of finite cost as there can be and, of
// those, the smallest sum. Returns the column of each row, -1 for none. An infinite cost forbids a pair; NaN
// is a bug. Takes O(min^2 * max) time. Kuhn's Hungarian method with shortest augmenting paths (Jonker and
// Volgenant, Computing 38, 1987).
std::vector<int> CheapestPairs(const Eigen::MatrixXd& costs);

}  // namespace dynamic_slam
