#include <algorithm>
#include <cmath>
#include <numbers>

#include "dynamic_slam/sim/color_materials.h"
#include "dynamic_slam/sim/furniture.h"
#include "dynamic_slam/sim/texture.h"
#include "dynamic_slam/sim/world.h"

namespace dynamic_slam {
namespace {

constexpr double kHeight = 2.8;  // m

void AddFloorAndCeiling(World& world, uint64_t seed, double length, double width) {
  Mesh mesh;
  Surface carpet = Painted(DrawCarpet(SubSeed(seed, 1), 1024), 3);
  carpet.takes_shadow = true;
  const int floor = mesh.AddSurface(carpet),
            ceiling = mesh.AddSurface(Painted(DrawCeiling(SubSeed(seed, 2), 1024, 6)));
  const double x = length / 2, y = width / 2;
  constexpr double kCarpet = 3.1, kPanels = 3.6;  // m, of one picture
  mesh.AddQuad(floor, {-x, y, 0}, {length, 0, 0}, {0, -width, 0}, {length / kCarpet, width / kCarpet});
  mesh.AddQuad(ceiling, {-x, -y, kHeight}, {length, 0, 0}, {0, width, 0},
               {length / kPanels, width / kPanels});
  world.Add(std::move(mesh), {});
}

}  // namespace

World MakeOffice(const SceneOptions& options) {
  World world;
  const uint64_t seed = SubSeed(options.seed, 1);
  Random random(seed);
  const double x = options.world.length_m / 2, y = options.world.width_m / 2;
  AddFloorAndCeiling(world, SubSeed(seed, 1), 2 * x, 2 * y);
  const Eigen::Vector2d corners[] = {{x, y}, {x, -y}, {-x, -y}, {-x, y}};
  for (int i = 0; i < 4; ++i) {
    AddWall(world, SubSeed(seed, 10 + static_cast<uint64_t>(i)), corners[i], corners[(i + 1) % 4], kHeight,
            options.world.richness, 0.7, i != 0);
  }
  // A row of desks ahead, their screens towards the camera, chairs before them; shelves and plants behind.
  const double row = x - 2.0;
  const int desks = std::max(1, static_cast<int>((2 * y - 1.2) / 1.75));
  for (int i = 0; i < desks; ++i) {
    const uint64_t part = SubSeed(seed, 100 + static_cast<uint64_t>(i));
    const double at = (i - 0.5 * (desks - 1)) * 1.75 + random.Uniform(-0.05, 0.05);
    const Eigen::Vector2d desk(row + random.Uniform(-0.08, 0.08), at);
    AddDesk(world, SubSeed(part, 1), desk, std::numbers::pi + random.Uniform(-0.05, 0.05), 1.6);
    const int monitors = 1 + static_cast<int>(random.Index(2));
    for (int k = 0; k < monitors; ++k) {
      const double shift = monitors == 1 ? random.Uniform(-0.2, 0.2) : 0.62 * (k - 0.5);
      AddMonitor(world, SubSeed(part, 2 + static_cast<uint64_t>(k)),
                 {desk.x() + 0.15, desk.y() + shift, 0.73}, std::numbers::pi + random.Uniform(-0.3, 0.3),
                 0.56);
    }
    const double turned = random.Uniform(-0.9, 0.9);
    AddChair(world, SubSeed(part, 5),
             {desk.x() - 0.55 - random.Uniform(0, 0.15), desk.y() + random.Uniform(-0.3, 0.3)}, turned);
  }
  for (const double side : {-1, 1}) {
    AddDesk(world, SubSeed(seed, side > 0 ? 201 : 202), {-0.1, side * (y - 0.45)},
            -side * std::numbers::pi / 2, 1.8);
    const double turned = random.Uniform(-0.4, 0.4);
    AddMonitor(world, SubSeed(seed, side > 0 ? 203 : 204),
               {-0.1 + random.Uniform(-0.3, 0.3), side * (y - 0.35), 0.73},
               -side * std::numbers::pi / 2 + turned, 0.56);
    AddPlant(world, SubSeed(seed, side > 0 ? 205 : 206), {x - 0.4, side * (y - 0.4)});
  }
  for (int i = 0; i < 2; ++i) {
    const double length = random.Uniform(0.9, 1.2);
    AddShelf(world, SubSeed(seed, 210 + static_cast<uint64_t>(i)),
             {x - 0.2, (2 * i - 1) * random.Uniform(0.7, 1.1)}, std::numbers::pi, length);
  }
  world.lighting.to_sun = {-0.4, 0.3, 0.9};
  world.lighting.ambient = 0.72f;
  world.camera_centre = {-x + 1.35, random.Uniform(-0.2, 0.2), options.camera.height_m};
  world.camera_target = {row, random.Uniform(-0.2, 0.2), 1.0};
  // People walk between the camera and the desks, and behind the desks.
  const double near_x = world.camera_centre.x() + 1.55, reach = y - 1.15;
  world.walks.push_back(PlanarPath::ToAndFro({near_x, -reach}, {near_x + 0.3, reach}, 0.5));
  world.walks.push_back(PlanarPath::ToAndFro({x - 1.0, reach}, {x - 1.0, -reach}, 0.5));
  world.walks.push_back(PlanarPath::ToAndFro({near_x + 0.75, reach * 0.8}, {near_x + 0.7, -reach}, 0.4));
  return world;
}

}  // namespace dynamic_slam
