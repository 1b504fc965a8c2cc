#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace dynamic_slam {

// Seeded random numbers that are the same on every platform and standard library (splitmix64; Steele,
// Lea and Flood 2014). The standard's distributions are not. Nor is the order in which a compiler evaluates
// arguments and operands: draws that must not change places stand in statements of their own, or in braces.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}

  uint64_t Next() {
    uint64_t z = (state_ += 0x9e3779b97f4a7c15ULL);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
  }

  // Uniform in [0, n), n > 0.
  uint32_t Index(uint32_t n) { return static_cast<uint32_t>(((Next() >> 32) * n) >> 32); }

  // Uniform in [0, 1).
  double Uniform() { return static_cast<double>(Next() >> 11) * 0x1.0p-53; }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }

  // Gaussian with mean 0 and standard deviation 1 (Box-Muller).
  double Gaussian() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * Uniform());
  }

 private:
  uint64_t state_;
};

}  // namespace dynamic_slam
