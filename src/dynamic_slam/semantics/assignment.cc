#include "dynamic_slam/semantics/assignment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

// The column of each row; there are at most as many rows as columns, and all costs are finite.
std::vector<int> AssignRows(const Eigen::MatrixXd& costs) {
  const int rows = static_cast<int>(costs.rows());
  const int columns = static_cast<int>(costs.cols());
  // Potentials: cost - row_price - column_price is never negative and 0 on pairs. Index 0 is a helper: the
  // row that is being placed sits in column 0.
  std::vector<double> row_price(rows + 1, 0.0);
  std::vector<double> column_price(columns + 1, 0.0);
  std::vector<int> row_of(columns + 1, 0);     // 0 is none
  std::vector<int> came_from(columns + 1, 0);  // the column before on the path
  for (int row = 1; row <= rows; ++row) {
    row_of[0] = row;
    int column = 0;
    std::vector<double> distance(columns + 1, std::numeric_limits<double>::infinity());
    std::vector<bool> is_done(columns + 1, false);
    do {  // Dijkstra's search for the nearest free column
      is_done[column] = true;
      const int from = row_of[column];
      int nearest = 0;
      double step = std::numeric_limits<double>::infinity();
      for (int c = 1; c <= columns; ++c) {
        if (is_done[c]) continue;
        const double reduced = costs(from - 1, c - 1) - row_price[from] - column_price[c];
        if (reduced < distance[c]) {
          distance[c] = reduced;
          came_from[c] = column;
        }
        if (distance[c] < step) {
          step = distance[c];
          nearest = c;
        }
      }
      for (int c = 0; c <= columns; ++c) {
        if (is_done[c]) {
          row_price[row_of[c]] += step;
          column_price[c] -= step;
        } else {
          distance[c] -= step;
        }
      }
      column = nearest;
    } while (row_of[column] != 0);
    while (column != 0) {  // shift the rows along the path
      row_of[column] = row_of[came_from[column]];
      column = came_from[column];
    }
  }
  std::vector<int> column_of(rows, -1);
  for (int c = 1; c <= columns; ++c) {
    if (row_of[c] != 0) column_of[row_of[c] - 1] = c - 1;
  }
  return column_of;
}

}  // namespace

std::vector<int> CheapestPairs(const Eigen::MatrixXd& costs) {
  std::vector<int> column_of(costs.rows(), -1);
  if (costs.size() == 0) return column_of;
  DS_CHECK(!costs.hasNaN());
  // A forbidden pair costs more than all allowed ones together can save.
  double range = 0;
  for (const double cost : costs.reshaped()) {
    if (std::isfinite(cost)) range = std::max(range, std::abs(cost));
  }
  const double forbidden = (2 * range + 1) * (std::min(costs.rows(), costs.cols()) + 1);
  const Eigen::MatrixXd finite = costs.unaryExpr([&](double c) { return std::isfinite(c) ? c : forbidden; });
  if (costs.rows() <= costs.cols()) {
    column_of = AssignRows(finite);
  } else {
    const std::vector<int> row_of = AssignRows(finite.transpose());
    for (int column = 0; column < static_cast<int>(row_of.size()); ++column) {
      column_of[row_of[column]] = column;
    }
  }
  for (int row = 0; row < static_cast<int>(column_of.size()); ++row) {
    if (column_of[row] >= 0 && !std::isfinite(costs(row, column_of[row]))) column_of[row] = -1;
  }
  return column_of;
}

}  // namespace dynamic_slam
