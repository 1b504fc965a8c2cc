#include <algorithm>
#include <cmath>
#include <numbers>

#include "dynamic_slam/sim/car.h"
#include "dynamic_slam/sim/color_materials.h"
#include "dynamic_slam/sim/furniture.h"
#include "dynamic_slam/sim/street_furniture.h"
#include "dynamic_slam/sim/texture.h"
#include "dynamic_slam/sim/world.h"

namespace dynamic_slam {
namespace {

// A road around a block, houses on both sides. Distances from its centre line, m.
constexpr double kLane = 1.75, kKerb = 5.7, kHouses = 8.9, kParking = 4.6, kRadius = 10;

// The rectangle of the centre line, widened by `out`, counter-clockwise from a place on the first side.
std::vector<Eigen::Vector2d> Around(double length, double width, double out) {
  return {{0.35 * length, -out},
          {length + out, -out},
          {length + out, width + out},
          {-out, width + out},
          {-out, -out}};
}

PlanarPath Ring(double length, double width, double out, bool clockwise) {
  std::vector<Eigen::Vector2d> corners = Around(length, width, out);
  if (clockwise) std::reverse(corners.begin() + 1, corners.end());
  return PlanarPath(corners, std::max(kRadius + out, 1.0), true);
}

// A side of the block: a line of the centre line, in the direction of travel.
struct Side {
  Eigen::Vector2d from, to;
  Eigen::Vector2d Along() const { return (to - from).normalized(); }
  Eigen::Vector2d Outward() const { return {Along().y(), -Along().x()}; }
  double Length() const { return (to - from).norm(); }
  double Yaw() const { return std::atan2(Along().y(), Along().x()); }
  Eigen::Vector2d At(double along_m, double out_m) const {
    return from + along_m * Along() + out_m * Outward();
  }
};

void AddFlat(World& world, const Surface& surface, const Eigen::Vector2d& low, const Eigen::Vector2d& high,
             double z, double texture_m) {
  Mesh mesh;
  const Eigen::Vector2d size = high - low;
  mesh.AddQuad(mesh.AddSurface(surface), {-size.x() / 2, size.y() / 2, 0}, {size.x(), 0, 0},
               {0, -size.y(), 0}, size / texture_m);
  const Eigen::Vector2d middle = 0.5 * (low + high);
  world.Add(std::move(mesh), {Eigen::Quaterniond::Identity(), {middle.x(), middle.y(), z}});
}

void AddGround(World& world, uint64_t seed, double length, double width) {
  Surface asphalt = Painted(DrawAsphalt(SubSeed(seed, 1), 1024), 3),
          paving = Painted(DrawPaving(SubSeed(seed, 2), 512), 3);
  asphalt.takes_shadow = paving.takes_shadow = true;
  constexpr double kBeyond = 60;
  const Eigen::Vector2d low(-kHouses, -kHouses), high(length + kHouses, width + kHouses),
      far(kBeyond, kBeyond);
  AddFlat(world, asphalt, low - far, high + far, 0, 6);
  const Eigen::Vector2d kerb(kKerb, kKerb), block(length, width);
  AddFlat(world, paving, kerb, block - kerb, 0.02, 4);
  // The outer pavement, in four parts about the road.
  const double strip = kHouses - kKerb + 0.4;
  const Eigen::Vector2d a = -kerb, b = block + kerb;
  AddFlat(world, paving, {a.x() - strip, a.y() - strip}, {b.x() + strip, a.y()}, 0.02, 4);
  AddFlat(world, paving, {a.x() - strip, b.y()}, {b.x() + strip, b.y() + strip}, 0.02, 4);
  AddFlat(world, paving, {a.x() - strip, a.y()}, {a.x(), b.y()}, 0.02, 4);
  AddFlat(world, paving, {b.x(), a.y()}, {b.x() + strip, b.y()}, 0.02, 4);
}

// Lines, repairs, covers and kerbs of one side.
void AddRoadDetails(World& world, uint64_t seed, const Side& side, double corner) {
  Random random(seed);
  Mesh mesh;
  Surface white = Painted(DrawPlain(SubSeed(seed, 1), 128, cv::Scalar(215, 220, 220), 10), 2);
  white.takes_shadow = true;
  const int line = mesh.AddSurface(white);
  std::vector<int> repairs;
  for (int i = 0; i < 4; ++i) {
    Surface repair = Painted(DrawAsphalt(SubSeed(seed, 10 + static_cast<uint64_t>(i)), 256), 1);
    repair.tint *= static_cast<float>(random.Uniform(0.6, 1.25));
    repair.takes_shadow = true;
    repairs.push_back(mesh.AddSurface(repair));
  }
  const int kerb =
      mesh.AddSurface(Painted(DrawPlain(SubSeed(seed, 2), 256, cv::Scalar(165, 168, 170), 9), 4));
  const double length = side.Length();
  // In the frame of the side: x along, y to the left (towards the block).
  const auto flat = [&](int surface, double x, double y, double dx, double dy, double z) {
    mesh.AddQuad(surface, {x, y + dy, z}, {dx, 0, 0}, {0, -dy, 0});
  };
  for (double x = corner; x + 3 < length - corner; x += 9) flat(line, x, -0.06, 3, 0.12, 0.012);
  for (const double x : {corner - 3.5, length - corner + 0.5}) {  // zebra crossings
    for (double y = -kKerb + 0.4; y < kKerb - 0.4; y += 1.0) flat(line, x, y, 3, 0.5, 0.012);
  }
  for (int i = 0; i < static_cast<int>(length / 4); ++i) {
    const double dy = random.Uniform(0.4, 1.3), dx = random.Uniform(0.5, 3),
                 y = random.Uniform(-kKerb + 0.3, kKerb - 1.5),
                 x = random.Uniform(corner, length - corner - 3);
    flat(repairs[random.Index(4)], x, y, dx, dy, 0.004 + 0.001 * (i % 5));
  }
  for (const double y : {-kKerb - 0.08, kKerb + 0.08}) {
    for (double x = corner; x < length - corner; x += 12) {
      const double part = std::min(12.0, length - corner - x);
      mesh.AddBox(kerb, {x + part / 2, y, 0.06}, {part, 0.16, 0.12}, 0, 3);
    }
  }
  world.Add(std::move(mesh), {ExpSo3({0, 0, side.Yaw()}), {side.from.x(), side.from.y(), 0}});
}

void AddHouses(World& world, uint64_t seed, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
               double depth) {
  // The fronts look to the left of the way from one end to the other.
  Random random(seed);
  const Eigen::Vector2d along = (to - from).normalized(), front(-along.y(), along.x());
  const double yaw = std::atan2(front.y(), front.x()), length = (to - from).norm();
  double x = 0;
  for (uint64_t i = 0; x < length - 4; ++i) {
    double width = random.Uniform(9, 19);
    if (length - x - width < 9) width = length - x;
    const double height = random.Uniform(8, 17);
    AddHouse(world, SubSeed(seed, i), from + (x + width / 2) * along + random.Uniform(-0.5, 0.3) * front, yaw,
             width, height, depth);
    x += width;
  }
}

void AddPavementThings(World& world, uint64_t seed, const Side& side, double sign, double corner,
                       const std::vector<TreeModel>& trees) {
  Random random(seed);
  for (double x = corner; x < side.Length() - corner;) {
    const Eigen::Vector2d at = side.At(x, sign * (kKerb + random.Uniform(0.5, 0.8)));
    const double inward = side.Yaw() + (sign > 0 ? 0.5 : -0.5) * std::numbers::pi;
    switch (random.Index(6)) {
      case 0:
        AddLamp(world, at, inward);
        break;
      case 1:
        AddSign(world, random.Next(), at, side.Yaw() + std::numbers::pi);
        break;
      case 2:
        AddBin(world, random.Next(), at, inward);
        break;
      default: {
        const double yaw_rad = random.Uniform(0, 6.28);
        AddTree(world, trees[random.Index(static_cast<uint32_t>(trees.size()))], at, yaw_rad);
      }
    }
    if (random.Index(3) == 0) AddPlant(world, random.Next(), side.At(x + 2, sign * (kHouses - 0.55)));
    x += random.Uniform(5, 10);
  }
}

void AddParkedCars(World& world, uint64_t seed, const Side& side, double sign, double corner, double share,
                   const std::vector<Car>& models) {
  Random random(seed);
  Mesh shade;
  Surface dark = Painted(DrawPlain(SubSeed(seed, 1), 64, cv::Scalar::all(34), 5), 2);
  const int surface = shade.AddSurface(dark);
  for (double x = corner + 4; x < side.Length() - corner - 4; x += 6.1) {
    if (random.Uniform() > share) continue;
    const Car& car = models[random.Index(static_cast<uint32_t>(models.size()))];
    const bool turned = random.Index(12) == 0;
    const double heading =
        side.Yaw() + ((sign < 0) != turned ? std::numbers::pi : 0) + random.Uniform(-0.03, 0.03);
    const double along = x + random.Uniform(-0.3, 0.3), out = sign * (kParking + random.Uniform(-0.1, 0.1));
    std::vector<MeshInstance> parts;
    car.Place(side.At(along, out), heading, random.Uniform(0, 2), world.AddObject("car", false), &parts,
              nullptr);
    for (MeshInstance& part : parts) {
      part.max_distance_m = std::min(part.max_distance_m, 160.0f);
      world.statics.push_back(part);
    }
    const double half = 0.5 * car.length_m() - 0.1;
    shade.AddQuad(surface, {along - half, -out + 0.8, 0.015}, {2 * half, 0, 0}, {0, -1.6, 0});
  }
  if (!shade.triangles.empty()) {
    world.Add(std::move(shade), {ExpSo3({0, 0, side.Yaw()}), {side.from.x(), side.from.y(), 0}});
  }
}

}  // namespace

World MakeStreet(const SceneOptions& options) {
  World world;
  const uint64_t seed = SubSeed(options.seed, 1);
  const double length = std::max(options.world.length_m, 45.0), width = std::max(options.world.width_m, 45.0);
  AddGround(world, SubSeed(seed, 1), length, width);
  std::vector<TreeModel> trees;
  for (uint64_t i = 0; i < 5; ++i) trees.push_back(MakeTree(SubSeed(seed, 20 + i)));
  std::vector<Car> cars;
  for (uint64_t i = 0; i < 14; ++i) cars.emplace_back(SubSeed(seed, 40 + i));
  const Eigen::Vector2d corners[] = {{0, 0}, {length, 0}, {length, width}, {0, width}};
  constexpr double kCorner = kRadius + 4;
  for (uint64_t i = 0; i < 4; ++i) {
    const Side side{corners[i], corners[(i + 1) % 4]};
    const uint64_t part = SubSeed(seed, 100 + i);
    AddRoadDetails(world, SubSeed(part, 1), side, kCorner);
    // Inside, fronts look away from the block; outside, towards it, and the row reaches around the corner.
    AddHouses(world, SubSeed(part, 2), side.At(side.Length() - kHouses, -kHouses), side.At(kHouses, -kHouses),
              9);
    AddHouses(world, SubSeed(part, 3), side.At(-kHouses, kHouses), side.At(side.Length() + kHouses, kHouses),
              12);
    for (const double sign : {-1.0, 1.0}) {
      const uint64_t half = SubSeed(part, sign > 0 ? 4 : 5);
      AddPavementThings(world, SubSeed(half, 1), side, sign, sign > 0 ? 2 : kCorner, trees);
      AddParkedCars(world, SubSeed(half, 2), side, sign, kCorner, options.cars.parked_share, cars);
    }
  }
  world.lighting.to_sun = {-0.35, 0.5, 0.8};
  world.lighting.ambient = 0.68f;
  world.lighting.sun = 0.42f;
  world.lighting.backdrop = std::make_shared<ColorTexture>(DrawSky(SubSeed(seed, 2), 2048, 1024));
  world.lanes = {Ring(length, width, kLane, false), Ring(length, width, -kLane, true)};
  world.camera_path = {world.lanes.front()};
  const PlanarPath::Place start = world.lanes.front().At(0), ahead = world.lanes.front().At(10);
  world.camera_centre = {start.position.x(), start.position.y(), options.camera.height_m};
  world.camera_target = {ahead.position.x(), ahead.position.y(), options.camera.height_m};
  for (const double out : {kHouses - 1.6, -kHouses + 1.7}) {
    for (const bool clockwise : {false, true})
      world.walks.push_back(Ring(length, width, out + (clockwise ? 0.5 : -0.1), clockwise));
  }
  return world;
}

}  // namespace dynamic_slam
