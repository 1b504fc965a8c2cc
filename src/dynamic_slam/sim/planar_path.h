#pragma once

#include <vector>

#include <Eigen/Core>

namespace dynamic_slam {

// A way over the floor: straight lines between corners, which are rounded by arcs.
class PlanarPath {
 public:
  struct Place {
    Eigen::Vector2d position;  // m
    double heading_rad;        // of travel, about z, 0 is along x; not wrapped along the way
  };

  // `corners`: at least two, m. Arcs have `radius_m`, or less where the corners are close. A closed path
  // returns from the last corner to the first.
  PlanarPath(const std::vector<Eigen::Vector2d>& corners, double radius_m, bool closed);

  // Around the two ends of a line, to and fro, half `width_m` beside it.
  static PlanarPath ToAndFro(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double width_m);

  double length_m() const { return length_m_; }
  bool closed() const { return closed_; }

  // After `distance_m` along it; a closed path goes round and round, an open one ends.
  Place At(double distance_m) const;

 private:
  struct Piece {
    double begin_m, length_m;
    Place start;
    double curvature;  // rad / m
  };
  void Append(double length_m, double curvature);

  std::vector<Piece> pieces_;
  Place end_;
  double length_m_ = 0;
  bool closed_;
};

}  // namespace dynamic_slam
