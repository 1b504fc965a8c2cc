#pragma once

#include <cstdint>

#include "dynamic_slam/sim/world.h"

namespace dynamic_slam {

// A house whose front looks along `yaw_rad`, `front`: the middle of the front's foot.
void AddHouse(World& world, uint64_t seed, const Eigen::Vector2d& front, double yaw_rad, double width_m,
              double height_m, double depth_m);

// Trees of one seed are alike: made once, and put where they stand.
struct TreeModel {
  std::shared_ptr<const Mesh> wood_and_crown, leaves;
};
TreeModel MakeTree(uint64_t seed);
void AddTree(World& world, const TreeModel& tree, const Eigen::Vector2d& position, double yaw_rad);

// A lamp on a mast, or a sign on a pole that looks along `yaw_rad`.
void AddLamp(World& world, const Eigen::Vector2d& position, double yaw_rad);
void AddSign(World& world, uint64_t seed, const Eigen::Vector2d& position, double yaw_rad);
void AddBin(World& world, uint64_t seed, const Eigen::Vector2d& position, double yaw_rad);

}  // namespace dynamic_slam
