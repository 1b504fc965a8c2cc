#include "dynamic_slam/sim/furniture.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "dynamic_slam/sim/color_materials.h"
#include "dynamic_slam/sim/texture.h"

namespace dynamic_slam {
namespace {

Rigid3 Standing(const Eigen::Vector2d& position, double yaw_rad) {
  return {ExpSo3({0, 0, yaw_rad}), {position.x(), position.y(), 0}};
}

}  // namespace

Surface Painted(const cv::Mat& picture, float grain) {
  Surface surface;
  surface.texture = std::make_shared<ColorTexture>(picture);
  surface.detail_repeat = grain;
  return surface;
}

void AddDesk(World& world, uint64_t seed, const Eigen::Vector2d& position, double yaw_rad, double length_m) {
  Random random(seed);
  Mesh mesh;
  constexpr double kHeight = 0.73, kDepth = 0.8;
  const int top = mesh.AddSurface(Painted(DrawClutter(SubSeed(seed, 1), 512, 1024), 2));
  const int wood = mesh.AddSurface(Painted(DrawWood(SubSeed(seed, 2), 256, 256), 2));
  mesh.AddBox(wood, {0, 0, kHeight - 0.02}, {kDepth, length_m, 0.036}, 0, 0.8);
  mesh.AddQuad(top, {-kDepth / 2, length_m / 2, kHeight}, {0, -length_m, 0}, {kDepth, 0, 0}, {0, 0}, {1, 1});
  for (const double y : {-0.5, 0.5}) {
    mesh.AddBox(wood, {0, y * (length_m - 0.06), kHeight / 2 - 0.02}, {kDepth * 0.9, 0.04, kHeight - 0.04}, 0,
                0.8);
  }
  mesh.AddBox(wood, {-0.1, -length_m / 2 + 0.3, 0.34}, {0.6, 0.45, 0.68}, 0, 0.7);
  // Books, boxes and cups.
  const int things = 4 + static_cast<int>(random.Index(5));
  for (int i = 0; i < things; ++i) {
    const double height = random.Uniform(0.02, 0.22), width = random.Uniform(0.06, 0.28),
                 depth = random.Uniform(0.06, 0.28);
    const Eigen::Vector3d size(depth, width, height);
    const double y = random.Uniform(-0.45, 0.45) * length_m, x = random.Uniform(-0.32, 0.1);
    const Eigen::Vector3d at(x, y, kHeight + size.z() / 2);
    const int surface = mesh.AddSurface(Painted(DrawPoster(SubSeed(seed, 10 + i), 128, 128), 1));
    if (random.Index(3) == 0) {
      const std::vector<Mesh::Ring> cup = {{at - Eigen::Vector3d(0, 0, size.z() / 2), 0.035, 0.035},
                                           {{at.x(), at.y(), kHeight + 0.1}, 0.042, 0.042}};
      mesh.AddLoft(surface, cup, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 10);
    } else {
      mesh.AddBox(surface, at, size, random.Uniform(0, 3));
    }
  }
  world.Add(std::move(mesh), Standing(position, yaw_rad));
}

void AddChair(World& world, uint64_t seed, const Eigen::Vector2d& position, double yaw_rad) {
  Random random(seed);
  Mesh mesh;
  const int cloth =
      mesh.AddSurface(Painted(DrawPlain(SubSeed(seed, 1), 256, AnyColor(random, 0.1, 0.7, 0.8), 10), 2));
  const int steel = mesh.AddSurface(Painted(DrawPlain(SubSeed(seed, 2), 64, cv::Scalar::all(60), 14), 1));
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY();
  const std::vector<Mesh::Ring> seat = {{{0, 0, 0.42}, 0.20, 0.20},
                                        {{0, 0, 0.44}, 0.24, 0.24},
                                        {{0, 0, 0.48}, 0.24, 0.24},
                                        {{0, 0, 0.50}, 0.20, 0.21}};
  mesh.AddLoft(cloth, seat, x, y, 14);
  const std::vector<Mesh::Ring> back = {{{-0.20, 0, 0.58}, 0.03, 0.16},
                                        {{-0.22, 0, 0.64}, 0.035, 0.21},
                                        {{-0.25, 0, 0.85}, 0.035, 0.21},
                                        {{-0.27, 0, 1.0}, 0.025, 0.17}};
  mesh.AddLoft(cloth, back, x, y, 12);
  mesh.AddBox(steel, {-0.22, 0, 0.53}, {0.03, 0.06, 0.2});
  mesh.AddBox(steel, {0, 0, 0.27}, {0.05, 0.05, 0.32});
  for (int i = 0; i < 5; ++i) {
    const double angle = 2 * std::numbers::pi * i / 5;
    mesh.AddBox(steel, {0.15 * std::cos(angle), 0.15 * std::sin(angle), 0.09}, {0.3, 0.04, 0.035}, angle);
    mesh.AddEllipsoid(steel, {0.28 * std::cos(angle), 0.28 * std::sin(angle), 0.04}, {0.03, 0.03, 0.04}, 8,
                      5);
  }
  for (const double side : {-1, 1}) {
    mesh.AddBox(steel, {-0.02, side * 0.27, 0.66}, {0.24, 0.05, 0.03});
    mesh.AddBox(steel, {-0.05, side * 0.27, 0.55}, {0.03, 0.03, 0.22});
  }
  world.Add(std::move(mesh), Standing(position, yaw_rad), world.AddObject("chair", false));
}

void AddPlant(World& world, uint64_t seed, const Eigen::Vector2d& position) {
  Random random(seed);
  Mesh mesh;
  const int pot =
      mesh.AddSurface(Painted(DrawPlain(SubSeed(seed, 1), 128, AnyColor(random, 0.3, 0.9, 0.6), 8), 1));
  Surface leaf =
      Painted(DrawPlain(SubSeed(seed, 2), 64, cv::Scalar(50, 115, 60) * random.Uniform(0.7, 1.2), 14));
  leaf.two_sided = true;
  const int leaves = mesh.AddSurface(leaf);
  const std::vector<Mesh::Ring> rings = {
      {{0, 0, 0}, 0.13, 0.13}, {{0, 0, 0.36}, 0.18, 0.18}, {{0, 0, 0.37}, 0.15, 0.15}};
  mesh.AddLoft(pot, rings, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 14);
  const double height = random.Uniform(0.9, 1.5);
  for (int i = 0; i < 46; ++i) {
    const double angle = random.Uniform(0, 2 * std::numbers::pi), rise = random.Uniform(0.2, 1.2);
    const Eigen::Vector3d out(std::cos(angle) * std::cos(rise), std::sin(angle) * std::cos(rise),
                              std::sin(rise));
    const Eigen::Vector3d side =
        out.cross(Eigen::Vector3d::UnitZ()).normalized() * random.Uniform(0.035, 0.06);
    const Eigen::Vector3d root(0.05 * std::cos(angle), 0.05 * std::sin(angle),
                               0.35 + random.Uniform(0, 0.5) * (height - 0.35));
    const double length = random.Uniform(0.25, 0.45);
    const Eigen::Vector3d middle = root + 0.6 * length * out,
                          tip = root + length * (out - Eigen::Vector3d(0, 0, 0.25));
    const Eigen::Vector3d normal = side.cross(out);
    const int a = mesh.AddPoint(root, normal, {0.5, 0}), b = mesh.AddPoint(middle - side, normal, {0, 0.6}),
              c = mesh.AddPoint(middle + side, normal, {1, 0.6}), d = mesh.AddPoint(tip, normal, {0.5, 1});
    mesh.triangles.push_back({{a, b, c}, leaves});
    mesh.triangles.push_back({{c, b, d}, leaves});
  }
  world.Add(std::move(mesh), Standing(position, 0), world.AddObject("potted plant", false));
}

void AddShelf(World& world, uint64_t seed, const Eigen::Vector2d& position, double yaw_rad, double width_m) {
  Mesh mesh;
  constexpr double kHeight = 1.9, kDepth = 0.32;
  const int wood = mesh.AddSurface(Painted(DrawWood(SubSeed(seed, 2), 256, 256), 2));
  const int books = mesh.AddSurface(Painted(DrawBooks(SubSeed(seed, 1), 512, 1024), 3));
  mesh.AddBox(wood, {-0.01, 0, kHeight / 2}, {kDepth, width_m, kHeight}, 0, 0.9);
  mesh.AddQuad(books, {kDepth / 2, -width_m / 2, kHeight}, {0, width_m, 0}, {0, 0, -kHeight});
  world.Add(std::move(mesh), Standing(position, yaw_rad));
}

void AddMonitor(World& world, uint64_t seed, const Eigen::Vector3d& base, double yaw_rad, double width_m) {
  Mesh mesh;
  const double height = width_m * 0.6;
  Surface lit = Painted(DrawScreen(seed, 512, 320));
  lit.shines = true;
  const int screen = mesh.AddSurface(lit);
  const int shell = mesh.AddSurface(Painted(DrawPlain(SubSeed(seed, 2), 64, cv::Scalar::all(45), 8), 1));
  mesh.AddBox(shell, {0, 0, 0.12 + height / 2}, {0.035, width_m, height});
  mesh.AddQuad(screen, {0.02, -width_m / 2, 0.12 + height}, {0, width_m, 0}, {0, 0, -height});
  mesh.AddBox(shell, {-0.02, 0, 0.1}, {0.03, 0.05, 0.2});
  mesh.AddBox(shell, {-0.02, 0, 0.008}, {0.18, 0.26, 0.016});
  Rigid3 pose = Standing(base.head<2>(), yaw_rad);
  pose.translation.z() = base.z();
  world.Add(std::move(mesh), pose, world.AddObject("tv", false));
}

void AddOnWall(World& world, const cv::Mat& picture, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
               double along_m, double bottom_m, double width_m, double height_m, double off_wall_m) {
  const Eigen::Vector2d along = (to - from).normalized(), out(along.y(), -along.x());
  const Eigen::Vector2d corner = from + along_m * along + off_wall_m * out;
  Mesh mesh;
  const float grain = static_cast<float>(std::max(std::round(width_m), 1.0));
  mesh.AddQuad(mesh.AddSurface(Painted(picture, grain)), {0, 0, height_m},
               width_m * Eigen::Vector3d(along.x(), along.y(), 0), {0, 0, -height_m});
  world.Add(std::move(mesh), {Eigen::Quaterniond::Identity(), {corner.x(), corner.y(), bottom_m}});
}

void AddWall(World& world, uint64_t seed, const Eigen::Vector2d& from, const Eigen::Vector2d& to,
             double height_m, double richness, double unit_m, bool doors) {
  Random random(seed);
  const double length = (to - from).norm();
  // Long walls in parts, so that each has texels enough.
  const int parts = std::max(1, static_cast<int>(std::ceil(length / 7)));
  constexpr double kTexelsPerMetre = 140;
  const cv::Scalar color = AnyColor(random, 0.68, 0.92, 0.14);
  for (int i = 0; i < parts; ++i) {
    const double width = length / parts;
    AddOnWall(world,
              DrawWall(SubSeed(seed, static_cast<uint64_t>(i)), cvRound(width * kTexelsPerMetre),
                       cvRound(height_m * kTexelsPerMetre), color, richness),
              from, to, i * width, 0, width, height_m, 0);
  }
  double along = random.Uniform(0.2, 0.6);
  for (int i = 0; along < length; ++i) {
    const uint64_t part = SubSeed(seed, 100 + static_cast<uint64_t>(i));
    const uint32_t kind = random.Index(6);
    double width = random.Uniform(0.35, 0.9);
    if (kind == 0 && doors) {
      width = 0.95;
      if (along + width > length) break;
      AddOnWall(world, DrawDoor(part, 256, 512), from, to, along, 0, width, 2.05, 0.02);
    } else if (kind == 1) {  // a board with many sheets
      width = random.Uniform(1.0, 1.6);
      if (along + width > length) break;
      AddOnWall(world, DrawClutter(part, 512, 384), from, to, along, 1.0, width, 1.0, 0.02);
    } else {
      if (along + width > length) break;
      const double height = width * random.Uniform(0.8, 1.45);
      AddOnWall(world, DrawPoster(part, 256, 320), from, to, along,
                random.Uniform(0.9, std::max(0.95, height_m - height - 0.2)), width, height);
    }
    along += width + unit_m * random.Uniform(0.15, 0.8);
  }
}

}  // namespace dynamic_slam
