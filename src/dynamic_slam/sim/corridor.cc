#include <algorithm>
#include <numbers>

#include "dynamic_slam/sim/color_materials.h"
#include "dynamic_slam/sim/furniture.h"
#include "dynamic_slam/sim/street_furniture.h"
#include "dynamic_slam/sim/texture.h"
#include "dynamic_slam/sim/world.h"

namespace dynamic_slam {
namespace {

constexpr double kHalfWidth = 1.25, kHeight = 2.6, kTurn = 1.1;  // m

// The rectangle of the centre line widened by `out`, counter-clockwise.
std::vector<Eigen::Vector2d> Corners(double length, double width, double out) {
  return {{-out, -out}, {length + out, -out}, {length + out, width + out}, {-out, width + out}};
}

PlanarPath Ring(double length, double width, double out, bool clockwise) {
  // From a place on the first side, so that the start is no corner.
  const std::vector<Eigen::Vector2d> all = Corners(length, width, out);
  std::vector<Eigen::Vector2d> corners = {{0.2 * length, -out}, all[1], all[2], all[3], all[0]};
  if (clockwise) std::reverse(corners.begin() + 1, corners.end());
  return PlanarPath(corners, kTurn + out, true);
}

}  // namespace

World MakeCorridor(const SceneOptions& options) {
  World world;
  const uint64_t seed = SubSeed(options.seed, 1);
  Random random(seed);
  const double length = std::max(options.world.length_m, 6.0), width = std::max(options.world.width_m, 6.0);

  Mesh flat;
  Surface tiles = Painted(DrawTiles(SubSeed(seed, 1), 1024, 8), 3);
  tiles.takes_shadow = true;
  const int floor = flat.AddSurface(tiles);
  const int ceiling = flat.AddSurface(Painted(DrawCeiling(SubSeed(seed, 2), 1024, 6), 6));
  const double x = -kHalfWidth, dx = length + 2 * kHalfWidth, dy = width + 2 * kHalfWidth;
  flat.AddQuad(floor, {x, width + kHalfWidth, 0}, {dx, 0, 0}, {0, -dy, 0}, {dx / 3.2, dy / 3.2});
  flat.AddQuad(ceiling, {x, x, kHeight}, {dx, 0, 0}, {0, dy, 0}, {dx / 3.6, dy / 3.6});
  world.Add(std::move(flat), {});

  const std::vector<Eigen::Vector2d> outer = Corners(length, width, kHalfWidth),
                                     inner = Corners(length, width, -kHalfWidth);
  for (size_t i = 0; i < 4; ++i) {
    const uint64_t part = SubSeed(seed, 10 + i);
    AddWall(world, SubSeed(part, 1), outer[(i + 1) % 4], outer[i], kHeight, options.world.richness, 1.0,
            true);
    AddWall(world, SubSeed(part, 2), inner[i], inner[(i + 1) % 4], kHeight, options.world.richness, 1.0,
            true);
    // What stands along the outer wall, out of the way of those who walk.
    const Eigen::Vector2d from = outer[i], along = (outer[(i + 1) % 4] - from).normalized(),
                          in(-along.y(), along.x());
    const double yaw = std::atan2(in.y(), in.x()), end = (outer[(i + 1) % 4] - from).norm() - 1.2;
    for (double at = random.Uniform(0.6, 1.5); at < end; at += random.Uniform(2.0, 4.0)) {
      const uint64_t thing = random.Next();
      switch (random.Index(4)) {
        case 0:
          AddPlant(world, thing, from + at * along + 0.3 * in);
          break;
        case 1:
          AddChair(world, thing, from + at * along + 0.35 * in, yaw + random.Uniform(-0.3, 0.3));
          break;
        case 2:
          AddShelf(world, thing, from + at * along + 0.18 * in, yaw, random.Uniform(0.7, 1.1));
          break;
        default:
          AddBin(world, thing, from + at * along + 0.42 * in, yaw);
      }
    }
  }
  world.lighting.to_sun = {-0.3, 0.4, 0.9};
  world.lighting.ambient = 0.7f;
  world.camera_path = {Ring(length, width, 0, false)};
  const PlanarPath::Place start = world.camera_path.front().At(0);
  world.camera_centre = {start.position.x(), start.position.y(), options.camera.height_m};
  world.camera_target = world.camera_centre + Eigen::Vector3d(3, 0, 0);
  for (const bool clockwise : {true, false})
    world.walks.push_back(Ring(length, width, clockwise ? -0.6 : 0.45, clockwise));
  return world;
}

}  // namespace dynamic_slam
