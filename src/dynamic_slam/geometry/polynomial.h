#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace dynamic_slam {

// Value and derivative of sum_k coefficients[k] x^k.
inline void EvaluatePolynomial(const double* coefficients, int degree, double x, double* value,
                               double* slope) {
  *value = coefficients[degree];
  *slope = 0;
  for (int k = degree - 1; k >= 0; --k) {
    *slope = *slope * x + *value;
    *value = *value * x + coefficients[k];
  }
}

// Roots in [-1, 1], ascending, of a polynomial with `coefficients` from x^0 upwards; returns how many. Roots
// of even multiplicity may be missed. Between two extrema lies at most one root, so the roots of each
// derivative bracket those of the one above it.
template <int kDegree>
int RealRootsInUnitInterval(const std::array<double, kDegree + 1>& coefficients,
                            std::array<double, kDegree>* roots) {
  std::array<std::array<double, kDegree + 1>, kDegree> derivatives;  // [order]
  derivatives[0] = coefficients;
  for (int order = 1; order < kDegree; ++order) {
    for (int k = 0; k <= kDegree - order; ++k) {
      derivatives[order][k] = (k + 1) * derivatives[order - 1][k + 1];
    }
  }
  std::array<double, kDegree + 1> brackets;  // the roots of the level below, between -1 and 1
  int count = 0;
  for (int order = kDegree - 1; order >= 0; --order) {
    const double* p = derivatives[order].data();
    const int degree = kDegree - order;
    const double tolerance = order == 0 ? 1e-13 : 1e-6;  // brackets need not be exact
    const int bracket_count = count;
    std::copy_n(roots->begin(), bracket_count, brackets.begin());
    count = 0;
    double left = -1, value_left, slope;
    EvaluatePolynomial(p, degree, left, &value_left, &slope);
    for (int i = 0; i <= bracket_count; ++i) {
      const double right = i < bracket_count ? brackets[i] : 1.0;
      double value_right;
      EvaluatePolynomial(p, degree, right, &value_right, &slope);
      if ((value_left < 0) != (value_right < 0)) {
        // Newton's method, with bisection where it would leave the bracket.
        double low = left, high = right, x = 0.5 * (left + right);
        for (int iteration = 0; iteration < 60; ++iteration) {
          double value;
          EvaluatePolynomial(p, degree, x, &value, &slope);
          ((value < 0) == (value_left < 0) ? low : high) = x;
          double next = x - value / slope;
          if (!(next > low && next < high)) next = 0.5 * (low + high);
          const double step = std::abs(next - x);
          x = next;
          if (step < tolerance) break;
        }
        (*roots)[count++] = x;
      }
      left = right;
      value_left = value_right;
    }
  }
  return count;
}

// All real roots, in no particular order: those outside [-1, 1] are the inverse roots of the reversed
// polynomial.
template <int kDegree>
int RealRoots(const std::array<double, kDegree + 1>& coefficients, std::array<double, 2 * kDegree>* roots) {
  std::array<double, kDegree> found;
  int count = RealRootsInUnitInterval<kDegree>(coefficients, &found);
  std::copy_n(found.begin(), count, roots->begin());
  std::array<double, kDegree + 1> reversed = coefficients;
  std::reverse(reversed.begin(), reversed.end());
  const int outside = RealRootsInUnitInterval<kDegree>(reversed, &found);
  for (int i = 0; i < outside; ++i) {
    if (found[i] != 0) (*roots)[count++] = 1.0 / found[i];
  }
  return count;
}

}  // namespace dynamic_slam
