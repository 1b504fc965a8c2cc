#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "dynamic_slam/sim/mesh_renderer.h"

namespace dynamic_slam {

// A car of a kind (hatchback, saloon, estate, van) and colour that follow from the seed. Its wheels turn.
class Car {
 public:
  explicit Car(uint64_t seed);

  double length_m() const { return length_m_; }

  // Adds its parts, the middle of its floor at `position`, its front along `heading_rad`, after it has rolled
  // `rolled_m`.
  void Place(const Eigen::Vector2d& position, double heading_rad, double rolled_m, int object,
             std::vector<MeshInstance>* instances, std::vector<GroundShadow>* shadows) const;

 private:
  double length_m_, width_m_;
  double front_axle_m_, rear_axle_m_, wheel_radius_m_;
  std::shared_ptr<const Mesh> body_, wheel_;
};

}  // namespace dynamic_slam
