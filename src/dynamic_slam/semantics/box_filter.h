#pragma once

#include <array>

#include <Eigen/Core>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// Lengths are in sizes of the box: its size is the square root of its area, so a box twice as near behaves
// alike.
struct BoxFilterOptions {
  double position_noise = 0.05;
  double extent_noise = 0.1;
  double initial_velocity = 1.0;
  double velocity_noise = 1.5;
  double extent_rate_noise = 0.5;
  double motion_noise = 0.04;
  double velocity_memory_s = 1.0;
  double extent_memory_s = 0.3;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("position_noise", self.position_noise,
          OptionField{"", 0.001, 1, "Standard deviation of a detected centre, in sizes of the box."});
    visit("extent_noise", self.extent_noise,
          OptionField{"", 0.001, 1, "The same of a detected width and height, relative to them."});
    visit("initial_velocity", self.initial_velocity,
          OptionField{"", 0, 10, "How fast a new box may be, sizes per second."});
    visit("velocity_noise", self.velocity_noise,
          OptionField{"", 0, 20, "How much its velocity changes within a second, sizes per second."});
    visit("extent_rate_noise", self.extent_rate_noise,
          OptionField{"", 0, 20, "The same of the rates of its width and height, relative to them."});
    visit(
        "motion_noise", self.motion_noise,
        OptionField{
            "", 0.001, 1,
            "Standard deviation of a motion between two frames that the points in the box show, in sizes."});
    visit("velocity_memory_s", self.velocity_memory_s,
          OptionField{"s", 0.01, 100, "Time in which the velocity of an unseen box decays to a third."});
    visit("extent_memory_s", self.extent_memory_s,
          OptionField{"s", 0.01, 100, "The same of the rates of its width and height."});
  }
};

// A Kalman filter of a box: centre (px) and logarithms of width and height, each with its rate. The four do
// not depend on each other, so each is a filter of its own with two numbers. Rates decay to zero
// (Ornstein-Uhlenbeck): what is not seen is not trusted to go on moving for ever.
class BoxFilter {
 public:
  BoxFilter(const BoxFilterOptions& options, const Box& detected);

  // `elapsed_s` > 0 later.
  void Predict(const BoxFilterOptions& options, double elapsed_s);

  // The same when the centre was seen to move by `shift_px`, `background_px` of it because the image moves,
  // and the box to grow by `scale`.
  void Follow(const BoxFilterOptions& options, double elapsed_s, const Eigen::Vector2d& shift_px,
              double scale, const Eigen::Vector2d& background_px);

  // The image moved below the box: the centre by `shift_px`, small vectors about it by `jacobian`.
  void Move(const Eigen::Vector2d& shift_px, const Eigen::Matrix2d& jacobian);

  // `noise_factor` > 1 for a detection with more noise than others.
  void Update(const BoxFilterOptions& options, const Box& detected, double noise_factor = 1);

  // Squared distance of a detection from the prediction in sigmas, four degrees of freedom.
  double SquaredDistance(const BoxFilterOptions& options, const Box& detected) const;

  Box box() const;                        // may reach out of the image
  Eigen::Vector2d velocity_px_s() const;  // of the centre, without the image's motion

 private:
  struct Axis {
    double value = 0, rate = 0;
    // The covariance's elements.
    double value_value = 0, value_rate = 0, rate_rate = 0;

    void Predict(double elapsed_s, double rate_noise, double memory_s);
    void Update(double measured, double variance);
  };
  // Centre x, y in px; ln width, ln height.
  std::array<Axis, 4> axes_;
};

}  // namespace dynamic_slam
