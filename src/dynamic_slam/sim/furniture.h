#pragma once

#include <cstdint>

#include "dynamic_slam/sim/world.h"

namespace dynamic_slam {

// A surface with a picture, once over the whole of it.
Surface Painted(const cv::Mat& picture, float grain = 0);

// Furniture that stands on the floor at `position`, turned by `yaw_rad`: its front looks along x.
void AddDesk(World& world, uint64_t seed, const Eigen::Vector2d& position, double yaw_rad, double length_m);
void AddChair(World& world, uint64_t seed, const Eigen::Vector2d& position, double yaw_rad);
void AddPlant(World& world, uint64_t seed, const Eigen::Vector2d& position);
void AddShelf(World& world, uint64_t seed, const Eigen::Vector2d& position, double yaw_rad, double width_m);
// A flat screen on a foot, `base_m` above the floor.
void AddMonitor(World& world, uint64_t seed, const Eigen::Vector3d& base, double yaw_rad, double width_m);

// A picture on a wall. `from` and `to`: the two ends of the wall's foot, from left to right for one who looks
// at it; `along_m`: of the picture's left edge from `from`; `bottom_m`: above the floor.
void AddOnWall(World& world, const cv::Mat& picture, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
               double along_m, double bottom_m, double width_m, double height_m, double off_wall_m = 0.012);

// A wall of the height with posters, boards and doors on it. `unit_m`: about one thing in so many metres.
void AddWall(World& world, uint64_t seed, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
             double height_m, double richness, double unit_m, bool doors);

}  // namespace dynamic_slam
