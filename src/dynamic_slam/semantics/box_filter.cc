#include "dynamic_slam/semantics/box_filter.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace dynamic_slam {
namespace {

std::array<double, 4> Measured(const Box& box) {
  return {box.CenterX(), box.CenterY(), std::log(box.width), std::log(box.height)};
}

double Square(double x) { return x * x; }

// The box's size, px, of the logarithms of its width and height.
double Size(double log_width, double log_height) { return std::exp(0.5 * (log_width + log_height)); }

}  // namespace

void BoxFilter::Axis::Predict(double elapsed_s, double rate_noise, double memory_s) {
  const double keep = std::exp(-elapsed_s / memory_s);
  const double reach_s = memory_s * (1 - keep);  // the integral of the decaying rate
  value += rate * reach_s;
  rate *= keep;
  value_value += 2 * reach_s * value_rate + Square(reach_s) * rate_rate;
  value_rate = keep * (value_rate + reach_s * rate_rate);
  rate_rate *= Square(keep);
  // White acceleration; within a step the decay of what it adds does not matter.
  const double q = Square(rate_noise);
  value_value += q * std::pow(elapsed_s, 3) / 3;
  value_rate += q * Square(elapsed_s) / 2;
  rate_rate += q * elapsed_s;
}

void BoxFilter::Axis::Update(double measured, double variance) {
  const double innovation = measured - value;
  const double inverse = 1 / (value_value + variance);
  const double value_gain = value_value * inverse;
  const double rate_gain = value_rate * inverse;
  value += value_gain * innovation;
  rate += rate_gain * innovation;
  rate_rate -= rate_gain * value_rate;
  value_rate *= 1 - value_gain;
  value_value *= 1 - value_gain;
}

BoxFilter::BoxFilter(const BoxFilterOptions& options, const Box& detected) {
  const std::array<double, 4> measured = Measured(detected);
  const double size = Size(measured[2], measured[3]);
  for (int i = 0; i < 4; ++i) {
    Axis& axis = axes_[i];
    axis.value = measured[i];
    axis.value_value = Square(i < 2 ? options.position_noise * size : options.extent_noise);
    axis.rate_rate = Square(options.initial_velocity * (i < 2 ? size : 0.3));
  }
}

void BoxFilter::Predict(const BoxFilterOptions& options, double elapsed_s) {
  const double size = Size(axes_[2].value, axes_[3].value);
  for (int i = 0; i < 2; ++i) {
    axes_[i].Predict(elapsed_s, options.velocity_noise * size, options.velocity_memory_s);
    axes_[i + 2].Predict(elapsed_s, options.extent_rate_noise, options.extent_memory_s);
  }
  // No object grows or shrinks to nothing: a guard for long predictions.
  for (int i = 2; i < 4; ++i) axes_[i].value = std::clamp(axes_[i].value, 0.0, 10.0);
}

void BoxFilter::Follow(const BoxFilterOptions& options, double elapsed_s, const Eigen::Vector2d& shift_px,
                       double scale, const Eigen::Vector2d& background_px) {
  const double size = Size(axes_[2].value, axes_[3].value);
  const std::array<Axis, 4> before = axes_;
  Predict(options, elapsed_s);
  const std::array<double, 4> shifts = {shift_px.x(), shift_px.y(), std::log(scale), std::log(scale)};
  for (int i = 0; i < 4; ++i) {
    Axis& axis = axes_[i];
    const double variance = Square(options.motion_noise * (i < 2 ? size : 1));
    axis.value = before[i].value + shifts[i];
    axis.value_value = before[i].value_value + variance;
    axis.value_rate = 0;
    // The shift measures the rate too.
    const double own_shift = i < 2 ? shifts[i] - background_px[i] : shifts[i];
    const double gain = axis.rate_rate / (axis.rate_rate + variance / Square(elapsed_s));
    axis.rate += gain * (own_shift / elapsed_s - axis.rate);
    axis.rate_rate *= 1 - gain;
  }
}

void BoxFilter::Move(const Eigen::Vector2d& shift_px, const Eigen::Matrix2d& jacobian) {
  const Eigen::Vector2d rate = jacobian * Eigen::Vector2d(axes_[0].rate, axes_[1].rate);
  const double log_scale = 0.5 * std::log(std::max(std::abs(jacobian.determinant()), 1e-6));
  for (int i = 0; i < 2; ++i) {
    axes_[i].value += shift_px[i];
    axes_[i].rate = rate[i];
    axes_[i + 2].value += log_scale;
  }
}

void BoxFilter::Update(const BoxFilterOptions& options, const Box& detected, double noise_factor) {
  const std::array<double, 4> measured = Measured(detected);
  const double size = Size(axes_[2].value, axes_[3].value);
  for (int i = 0; i < 4; ++i) {
    const double noise = i < 2 ? options.position_noise * size : options.extent_noise;
    axes_[i].Update(measured[i], Square(noise_factor * noise));
  }
}

double BoxFilter::SquaredDistance(const BoxFilterOptions& options, const Box& detected) const {
  const std::array<double, 4> measured = Measured(detected);
  const double size = Size(axes_[2].value, axes_[3].value);
  double sum = 0;
  for (int i = 0; i < 4; ++i) {
    const double variance = Square(i < 2 ? options.position_noise * size : options.extent_noise);
    sum += Square(measured[i] - axes_[i].value) / (axes_[i].value_value + variance);
  }
  return sum;
}

Box BoxFilter::box() const {
  const double width = std::exp(axes_[2].value);
  const double height = std::exp(axes_[3].value);
  return {axes_[0].value - 0.5 * width, axes_[1].value - 0.5 * height, width, height};
}

Eigen::Vector2d BoxFilter::velocity_px_s() const { return {axes_[0].rate, axes_[1].rate}; }

}  // namespace dynamic_slam
