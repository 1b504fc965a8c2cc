#include "dynamic_slam/sim/street_furniture.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "dynamic_slam/sim/color_materials.h"
#include "dynamic_slam/sim/furniture.h"
#include "dynamic_slam/sim/texture.h"

namespace dynamic_slam {
namespace {

const Eigen::Vector3d kX(1, 0, 0), kY(0, 1, 0), kZ(0, 0, 1);

Eigen::Vector3d AnyVector(Random& random) {
  const double z = random.Gaussian(), y = random.Gaussian(), x = random.Gaussian();
  return {x, y, z};
}

Rigid3 Standing(const Eigen::Vector2d& position, double yaw_rad) {
  return {ExpSo3({0, 0, yaw_rad}), {position.x(), position.y(), 0}};
}

void AddPole(Mesh& mesh, int surface, double x, double height_m, double radius_m) {
  const std::vector<Mesh::Ring> rings = {{{x, 0, 0}, 1.4 * radius_m, 1.4 * radius_m},
                                         {{x, 0, 0.6}, 1.3 * radius_m, 1.3 * radius_m},
                                         {{x, 0, 0.65}, radius_m, radius_m},
                                         {{x, 0, height_m}, 0.8 * radius_m, 0.8 * radius_m}};
  mesh.AddLoft(surface, rings, kX, kY, 8);
}

}  // namespace

void AddHouse(World& world, uint64_t seed, const Eigen::Vector2d& front, double yaw_rad, double width_m,
              double height_m, double depth_m) {
  Random random(seed);
  Mesh mesh;
  const int columns = width_m > 14 ? 1024 : 512;
  const int facade = mesh.AddSurface(Painted(DrawFacade(SubSeed(seed, 1), columns, 512, width_m, height_m),
                                             static_cast<float>(std::round(width_m / 3))));
  const int wall =
      mesh.AddSurface(Painted(DrawWall(SubSeed(seed, 2), 256, 256, AnyColor(random, 0.5, 0.75, 0.3), 1), 3));
  const int roof = mesh.AddSurface(Painted(DrawTiles(SubSeed(seed, 3), 128, 16), 2));
  const double half = width_m / 2;
  mesh.AddQuad(facade, {0, -half, height_m}, {0, width_m, 0}, {0, 0, -height_m});
  mesh.AddQuad(wall, {-depth_m, -half, height_m}, {depth_m, 0, 0}, {0, 0, -height_m},
               {depth_m / 6, height_m / 6});
  mesh.AddQuad(wall, {0, half, height_m}, {-depth_m, 0, 0}, {0, 0, -height_m}, {depth_m / 6, height_m / 6});
  mesh.AddQuad(wall, {-depth_m, half, height_m}, {0, -width_m, 0}, {0, 0, -height_m},
               {width_m / 6, height_m / 6});
  if (random.Index(2) == 0) {  // a gable roof
    const double rise = random.Uniform(2, 3.5);
    const Eigen::Vector3d ridge(-depth_m / 2, 0, height_m + rise);
    mesh.AddQuad(roof, ridge + half * -kY, {0, width_m, 0},
                 Eigen::Vector3d(depth_m / 2 + 0.4, 0, -rise * 1.08), {4, 2});
    mesh.AddQuad(roof, ridge + half * kY, {0, -width_m, 0}, Eigen::Vector3d(-depth_m / 2, 0, -rise), {4, 2});
    for (const double sign : {-1.0, 1.0}) {
      const int a = mesh.AddPoint({0, sign * half, height_m}, sign * kY, {0, 0}),
                b = mesh.AddPoint({-depth_m, sign * half, height_m}, sign * kY, {1, 0}),
                c = mesh.AddPoint(ridge + sign * half * kY, sign * kY, {0.5, 0.5});
      if (sign > 0) {
        mesh.triangles.push_back({{a, c, b}, wall});
        mesh.triangles.push_back({{a, b, c}, wall});
      } else {
        mesh.triangles.push_back({{b, c, a}, wall});
        mesh.triangles.push_back({{b, a, c}, wall});
      }
    }
    const double x = -depth_m * random.Uniform(0.25, 0.4);
    mesh.AddBox(wall, {x, half * random.Uniform(-0.6, 0.6), height_m + rise * 0.8}, {0.7, 0.9, 2.2}, 0, 3);
  } else {
    mesh.AddBox(wall, {0.12, 0, height_m - 0.1}, {0.3, width_m, 0.35}, 0, 4);
  }
  // What stands out of the front.
  const int steps = mesh.AddSurface(Painted(DrawPaving(SubSeed(seed, 4), 64), 1));
  if (random.Index(2) == 0) mesh.AddBox(steps, {0.3, half * random.Uniform(-0.7, 0.7), 0.1}, {0.7, 1.6, 0.2});
  if (random.Index(2) == 0) {  // a sign across the pavement
    const int sign = mesh.AddSurface(Painted(DrawPoster(SubSeed(seed, 5), 64, 128), 1));
    mesh.AddBox(sign, {0.55, half * random.Uniform(-0.8, 0.8), random.Uniform(3.1, 3.8)}, {0.8, 0.08, 1.2});
  }
  world.Add(std::move(mesh), Standing(front, yaw_rad));
}

TreeModel MakeTree(uint64_t seed) {
  Random random(seed);
  auto tree = std::make_shared<Mesh>();
  const int bark = tree->AddSurface(Painted(DrawBark(SubSeed(seed, 1), 128), 1));
  const cv::Mat picture = DrawLeaves(SubSeed(seed, 2), 256);
  const int crown = tree->AddSurface(Painted(picture, 2));
  const double height = random.Uniform(5, 8.5), radius = random.Uniform(1.4, 2.3),
               trunk = random.Uniform(2.2, 2.8);
  const std::vector<Mesh::Ring> rings = {{{0, 0, 0}, 0.24, 0.24},
                                         {{0, 0, 0.4}, 0.17, 0.17},
                                         {{0.05, 0.03, trunk}, 0.13, 0.13},
                                         {{0.05, 0, height * 0.75}, 0.05, 0.05}};
  tree->AddLoft(bark, rings, kX, kY, 9);
  auto leaves = std::make_shared<Mesh>();
  Surface leaf = Painted(picture, 0);
  leaf.two_sided = true;
  const int foliage = leaves->AddSurface(leaf);
  constexpr int kBlobs = 9;
  for (int i = 0; i < kBlobs; ++i) {
    const double angle = 2.4 * i, out = radius * 0.55 * std::sqrt(static_cast<double>(i) / kBlobs);
    const Eigen::Vector3d centre(out * std::cos(angle), out * std::sin(angle),
                                 random.Uniform(trunk + 0.7, height - 0.9));
    const double z = random.Uniform(0.4, 0.6), y = random.Uniform(0.45, 0.65), x = random.Uniform(0.45, 0.65);
    const Eigen::Vector3d radii = radius * Eigen::Vector3d(x, y, z);
    tree->AddEllipsoid(crown, centre, radii, 10, 7);
    // Twigs that break the outline.
    for (int k = 0; k < 34; ++k) {
      const Eigen::Vector3d direction = AnyVector(random).normalized();
      const Eigen::Vector3d at = centre + direction.cwiseProduct(radii) * random.Uniform(0.9, 1.15);
      Eigen::Vector3d along = AnyVector(random);
      along = (along - 0.6 * along.dot(direction) * direction).normalized();
      const Eigen::Vector3d side = along.cross(direction).normalized();
      const double size = random.Uniform(0.16, 0.34);
      const double u = random.Uniform(0, 0.8), v = random.Uniform(0, 0.8);
      const int a = leaves->AddPoint(at - size * along, direction, {u, v}),
                b = leaves->AddPoint(at + size * side * 0.7, direction, {u + 0.2, v}),
                c = leaves->AddPoint(at + size * along, direction, {u + 0.2, v + 0.2}),
                d = leaves->AddPoint(at - size * side * 0.7, direction, {u, v + 0.2});
      leaves->triangles.push_back({{a, b, c}, foliage});
      leaves->triangles.push_back({{a, c, d}, foliage});
    }
  }
  return {tree, leaves};
}

void AddTree(World& world, const TreeModel& tree, const Eigen::Vector2d& position, double yaw_rad) {
  const Rigid3 pose = Standing(position, yaw_rad);
  world.statics.emplace_back(tree.wood_and_crown, pose, kNoObject, 200.0f);
  world.statics.emplace_back(tree.leaves, pose, kNoObject, 45.0f);
}

void AddLamp(World& world, const Eigen::Vector2d& position, double yaw_rad) {
  Mesh mesh;
  const int steel = mesh.AddSurface(Painted(DrawPlain(5, 64, cv::Scalar(95, 105, 95), 12), 2));
  AddPole(mesh, steel, 0, 6.2, 0.07);
  mesh.AddBox(steel, {0.8, 0, 6.2}, {1.7, 0.08, 0.08});
  mesh.AddBox(steel, {1.5, 0, 6.12}, {0.6, 0.24, 0.12});
  world.Add(std::move(mesh), Standing(position, yaw_rad), kNoObject, 120.0f);
}

void AddSign(World& world, uint64_t seed, const Eigen::Vector2d& position, double yaw_rad) {
  Mesh mesh;
  const int steel = mesh.AddSurface(Painted(DrawPlain(6, 64, cv::Scalar::all(150), 12), 2));
  AddPole(mesh, steel, -0.04, 2.7, 0.03);
  Surface front = Painted(DrawPoster(seed, 128, 128), 1);
  front.two_sided = true;
  mesh.AddQuad(mesh.AddSurface(front), {0, -0.35, 2.75}, {0, 0.7, 0}, {0, 0, -0.7});
  world.Add(std::move(mesh), Standing(position, yaw_rad), kNoObject, 80.0f);
}

void AddBin(World& world, uint64_t seed, const Eigen::Vector2d& position, double yaw_rad) {
  Random random(seed);
  Mesh mesh;
  const int plastic =
      mesh.AddSurface(Painted(DrawCloth(seed, 128, AnyColor(random, 0.15, 0.7, 0.8), false), 2));
  const double side = random.Uniform(0.5, 0.8), height = random.Uniform(0.7, 1.3);
  mesh.AddBox(plastic, {0, 0, height / 2 + 0.05}, {side, side * random.Uniform(0.9, 1.5), height});
  world.Add(std::move(mesh), Standing(position, yaw_rad), kNoObject, 80.0f);
}

}  // namespace dynamic_slam
