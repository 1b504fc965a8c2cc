#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "dynamic_slam/sim/mesh_renderer.h"

namespace dynamic_slam {

// Where in a walk somebody is.
struct WalkState {
  Eigen::Vector2d position{0, 0};  // m, on the floor
  double heading_rad = 0;
  double phase = 0;   // cycles of two steps
  double stride = 0;  // m, of two steps; 0: stands
};

// A person of ellipses: 13 rigid parts that swing about their joints as in a human walk. Height, build, skin,
// hair and clothes follow from the seed.
class Person {
 public:
  // richness: factor on the texture of the clothes.
  Person(uint64_t seed, double richness);

  double height_m() const { return height_m_; }

  // Adds the parts with feet on the floor, z = 0, and the shadow.
  void Place(const WalkState& state, int object, std::vector<MeshInstance>* instances,
             std::vector<GroundShadow>* shadows) const;

 private:
  enum Part { kPelvis, kTorso, kHead, kUpperArm, kForearm, kThigh, kShin, kFoot, kPartCount };

  double height_m_, scale_;  // scale: over the 1.75 m that the parts are drawn for
  std::array<std::shared_ptr<const Mesh>, kPartCount> parts_;
};

}  // namespace dynamic_slam
