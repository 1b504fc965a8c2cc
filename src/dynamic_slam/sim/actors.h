#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "dynamic_slam/sim/world.h"

namespace dynamic_slam {

// Somebody or something that moves through a world: a function of time.
class Actor {
 public:
  virtual ~Actor() = default;

  // Adds its parts and its shadow as they are at the time (s).
  virtual void Place(double time_s, std::vector<MeshInstance>* instances,
                     std::vector<GroundShadow>* shadows) const = 0;
};

// People and cars of a scene, each an object of the world: truth knows them by the index.
std::vector<std::unique_ptr<Actor>> MakeActors(const SceneOptions& options, World& world);

}  // namespace dynamic_slam
