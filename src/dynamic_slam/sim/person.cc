#include "dynamic_slam/sim/person.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "dynamic_slam/sim/color_materials.h"
#include "dynamic_slam/sim/texture.h"

namespace dynamic_slam {
namespace {

constexpr double kDrawnHeight =
    1.75;  // m; proportions of limbs after Winter, "Biomechanics" (2009), table 4.1
constexpr double kThighLength = 0.43, kShinLength = 0.42, kAnkleHeight = 0.075, kUpperArmLength = 0.30;
constexpr double kHipHalf = 0.095, kShoulderHalf = 0.200, kShoulderUp = 0.432;
const Eigen::Vector3d kX(1, 0, 0), kY(0, 1, 0), kZ(0, 0, 1);

using Ring = Mesh::Ring;

// A limb that hangs down from its joint: rings at {depth, radius}.
void AddLimb(Mesh& mesh, int surface, std::initializer_list<std::pair<double, double>> profile,
             double wide = 1) {
  std::vector<Ring> rings;
  for (const auto& [down, radius] : profile) rings.push_back({{0, 0, -down}, radius, radius * wide});
  mesh.AddLoft(surface, rings, kX, kY, 10);
}

Surface Covered(const cv::Mat& picture, float grain = 3) {
  Surface surface;
  surface.texture = std::make_shared<ColorTexture>(picture);
  surface.detail_repeat = grain;
  return surface;
}

double Degrees(double deg) { return deg * std::numbers::pi / 180; }

// Bends forward (a leg that swings ahead, an elbow) by a positive angle.
Rigid3 Bend(double angle_deg, const Eigen::Vector3d& joint) {
  return {ExpSo3({0, -Degrees(angle_deg), 0}), joint};
}

// A bump of a walk's curve, p in cycles.
double Bump(double p, double centre, double width) {
  const double x = std::remainder(p - centre, 1.0) / width;
  return std::exp(-x * x);
}

}  // namespace

Person::Person(uint64_t seed, double richness) {
  Random random(seed);
  const bool woman = random.Index(2) == 0;
  height_m_ = woman ? random.Uniform(1.56, 1.74) : random.Uniform(1.68, 1.92);
  scale_ = height_m_ / kDrawnHeight;
  const double build = random.Uniform(0.92, 1.15);
  const double tone = random.Uniform(0.35, 1.0);
  const cv::Scalar skin(150 * tone, 180 * tone, 225 * tone);
  const double hair_light = random.Uniform(0.12, 0.9);
  const cv::Scalar hair =
      random.Index(3) == 0 ? cv::Scalar(90, 140, 185) * hair_light : cv::Scalar(55, 62, 75) * hair_light;
  const cv::Scalar shirt = AnyColor(random, 0.15, 1.0, 0.9), trousers = AnyColor(random, 0.12, 0.65, 0.6);
  const bool short_sleeves = random.Index(2) == 0, skirt = woman && random.Index(3) == 0;
  const bool long_hair = woman && random.Index(3) != 0, backpack = random.Index(4) == 0;
  const Surface shirt_cloth = Covered(DrawCloth(SubSeed(seed, 1), 512, shirt, true, richness));
  const Surface sleeve_cloth = Covered(DrawCloth(SubSeed(seed, 1), 256, shirt, false, richness), 2);
  const Surface leg_cloth = Covered(DrawPlain(SubSeed(seed, 2), 256, trousers, 9 * richness), 2);
  const Surface bare = Covered(DrawPlain(SubSeed(seed, 3), 64, skin, 3), 1);
  const Surface hair_fibre = Covered(DrawPlain(SubSeed(seed, 4), 64, hair, 9), 1);
  const Surface shoe = Covered(DrawPlain(SubSeed(seed, 5), 64, AnyColor(random, 0.1, 0.9, 0.5), 10), 1);
  const Surface face = Covered(DrawFace(SubSeed(seed, 6), 256, skin, hair), 0);

  std::array<std::shared_ptr<Mesh>, kPartCount> parts;
  for (auto& part : parts) part = std::make_shared<Mesh>();
  const double b = build;

  Mesh& pelvis = *parts[kPelvis];
  if (skirt) {
    const std::vector<Ring> rings = {{{0, 0, 0.10}, 0.09 * b, 0.12 * b},
                                     {{0, 0, -0.02}, 0.12 * b, 0.17 * b},
                                     {{0, 0, -0.25}, 0.17 * b, 0.21 * b},
                                     {{0, 0, -0.46}, 0.20 * b, 0.23 * b}};
    pelvis.AddLoft(pelvis.AddSurface(Covered(DrawCloth(SubSeed(seed, 7), 256, trousers, false, richness), 3)),
                   rings, kX, kY, 14);
  } else {
    const std::vector<Ring> rings = {{{0, 0, 0.10}, 0.09 * b, 0.12 * b},
                                     {{0, 0, 0.0}, 0.115 * b, 0.165 * b},
                                     {{0, 0, -0.07}, 0.115 * b, 0.175 * b},
                                     {{0, 0, -0.13}, 0.07 * b, 0.12 * b}};
    pelvis.AddLoft(pelvis.AddSurface(leg_cloth), rings, kX, kY, 14);
  }

  Mesh& torso = *parts[kTorso];
  const double waist = woman ? 0.92 : 1.05, shoulders = woman ? 0.9 : 1.0;
  const std::vector<Ring> chest = {{{-0.005, 0, 0.545}, 0.050, 0.055},
                                   {{-0.005, 0, 0.515}, 0.070, 0.105 * shoulders},
                                   {{-0.005, 0, 0.485}, 0.088 * b, 0.175 * shoulders * b},
                                   {{0, 0, 0.44}, 0.105 * b, 0.195 * shoulders * b},
                                   {{0.01, 0, 0.36}, 0.120 * b, 0.185 * shoulders * b},
                                   {{0.005, 0, 0.22}, 0.115 * b * waist, 0.155 * b * waist},
                                   {{0.0, 0, 0.10}, 0.115 * b * waist, 0.15 * b * waist},
                                   {{0, 0, 0.0}, 0.14 * b, 0.19 * b},
                                   {{0, 0, -0.06}, 0.145 * b, 0.195 * b}};
  torso.AddLoft(torso.AddSurface(shirt_cloth), chest, kX, kY, 18);
  const std::vector<Ring> neck = {{{0.005, 0, 0.64}, 0.05, 0.052}, {{-0.005, 0, 0.52}, 0.058, 0.062}};
  torso.AddLoft(torso.AddSurface(bare), neck, kX, kY, 10);
  if (backpack) {
    const Surface pack =
        Covered(DrawCloth(SubSeed(seed, 8), 256, AnyColor(random, 0.1, 0.9, 0.9), false, richness), 2);
    torso.AddEllipsoid(torso.AddSurface(pack), {-0.17 * b, 0, 0.28}, {0.10, 0.15, 0.22}, 12, 9);
  }

  Mesh& head = *parts[kHead];  // about the top of the neck
  const std::vector<Ring> skull = {{{0.04, 0, -0.035}, 0.030, 0.030},  {{0.030, 0, -0.02}, 0.060, 0.050},
                                   {{0.018, 0, 0.02}, 0.083, 0.065},   {{0.008, 0, 0.07}, 0.094, 0.073},
                                   {{0.0, 0, 0.12}, 0.100, 0.077},     {{-0.004, 0, 0.165}, 0.094, 0.072},
                                   {{-0.008, 0, 0.195}, 0.070, 0.054}, {{-0.01, 0, 0.21}, 0.035, 0.028}};
  head.AddLoft(head.AddSurface(face), skull, kX, kY, 16);
  const int nose = head.AddSurface(bare);
  head.AddEllipsoid(nose, {0.108, 0, 0.055}, {0.018, 0.014, 0.024}, 8, 5);
  const int fibre = head.AddSurface(hair_fibre);
  head.AddEllipsoid(fibre, {-0.022, 0, 0.135}, {0.098, 0.085, 0.088}, 14, 8);
  if (long_hair) head.AddEllipsoid(fibre, {-0.055, 0, 0.03}, {0.065, 0.088, 0.17}, 12, 8);

  Mesh& upper_arm = *parts[kUpperArm];
  AddLimb(upper_arm, upper_arm.AddSurface(sleeve_cloth),
          {{-0.055, 0.02},
           {-0.040, 0.036},
           {-0.01, 0.052 * b},
           {0.08, 0.054 * b},
           {0.2, 0.048 * b},
           {0.29, 0.044},
           {0.33, 0.03}});
  Mesh& forearm = *parts[kForearm];
  AddLimb(forearm, forearm.AddSurface(short_sleeves ? bare : sleeve_cloth),
          {{-0.035, 0.02}, {-0.01, 0.043}, {0.07, 0.044 * b}, {0.18, 0.036}, {0.26, 0.029}, {0.28, 0.02}});
  AddLimb(forearm, forearm.AddSurface(bare),
          {{0.24, 0.018}, {0.28, 0.026}, {0.33, 0.040}, {0.38, 0.034}, {0.43, 0.022}, {0.45, 0.008}}, 0.55);

  const bool bare_legs = skirt || random.Index(7) == 0;
  Mesh& thigh = *parts[kThigh];
  AddLimb(thigh, thigh.AddSurface(skirt ? bare : leg_cloth),
          {{-0.06, 0.05},
           {-0.03, 0.078 * b},
           {0.05, 0.088 * b},
           {0.2, 0.077 * b},
           {0.36, 0.062 * b},
           {0.43, 0.056},
           {0.47, 0.04}});
  Mesh& shin = *parts[kShin];
  AddLimb(shin, shin.AddSurface(bare_legs ? bare : leg_cloth),
          {{-0.04, 0.035},
           {0.0, 0.056},
           {0.1, 0.059 * b},
           {0.25, 0.050},
           {0.37, bare_legs ? 0.038 : 0.056},
           {0.43, 0.035}});
  Mesh& foot = *parts[kFoot];  // about the ankle, the toes ahead
  const std::vector<Ring> sole = {{{-0.075, 0, -0.045}, 0.025, 0.02}, {{-0.06, 0, -0.037}, 0.038, 0.036},
                                  {{0.0, 0, -0.027}, 0.048, 0.042},   {{0.09, 0, -0.042}, 0.034, 0.048},
                                  {{0.16, 0, -0.052}, 0.023, 0.044},  {{0.195, 0, -0.057}, 0.012, 0.025}};
  foot.AddLoft(foot.AddSurface(shoe), sole, kZ, kY, 10);
  for (int i = 0; i < kPartCount; ++i) {
    for (Eigen::Vector3f& x : parts[i]->points) x *= static_cast<float>(scale_);
    parts_[i] = parts[i];
  }
}

void Person::Place(const WalkState& state, int object, std::vector<MeshInstance>* instances,
                   std::vector<GroundShadow>* shadows) const {
  // How far the legs swing so that the feet stand still on the floor: a step is 2 L sin(swing).
  const double leg = kThighLength + kShinLength;
  const double swing_deg =
      std::asin(std::min(state.stride / scale_ / (4 * leg), 0.6)) * 180 / std::numbers::pi;
  const double effort = std::min(swing_deg / 22, 1.3);
  struct Leg {
    Rigid3 thigh, shin, foot;
  };
  Leg legs[2];
  double lowest = 0;
  for (int side = 0; side < 2; ++side) {
    // Knee and ankle after the curves of Winter's "Biomechanics": bent a little under load, much in the
    // swing.
    const double p = state.phase + 0.5 * side;
    const double hip = 4 * effort + swing_deg * std::cos(2 * std::numbers::pi * p);
    const double knee = 4 + effort * (12 * Bump(p, 0.12, 0.09) + 55 * Bump(p, 0.73, 0.13));
    const double toes_down = effort * (48 * Bump(p, 0.63, 0.10) - 16 * Bump(p, 0.98, 0.09));
    Leg& l = legs[side];
    const double y = side == 0 ? kHipHalf : -kHipHalf;
    l.thigh = Bend(hip, {0, y, -0.02});
    l.shin = l.thigh * Bend(-knee, {0, 0, -kThighLength});
    const Eigen::Vector3d ankle = l.shin * Eigen::Vector3d(0, 0, -kShinLength);
    l.foot = Bend(-toes_down, ankle);
    for (const double x : {-0.075, 0.18})
      lowest = std::min(lowest, (l.foot * Eigen::Vector3d(x, 0, -kAnkleHeight)).z());
  }
  const double turn = 2 * std::numbers::pi * state.phase;
  const Rigid3 world_from_floor(ExpSo3({0, 0, state.heading_rad}),
                                {state.position.x(), state.position.y(), 0});
  const auto add = [&](Part part, Rigid3 pelvis_from_part) {
    Rigid3 floor_from_part = Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -lowest}) * pelvis_from_part;
    floor_from_part.translation *= scale_;
    instances->emplace_back(parts_[part], world_from_floor * floor_from_part, object);
  };
  add(kPelvis, {});
  // The shoulders turn against the hips, and lean ahead.
  const Rigid3 torso(
      ExpSo3({0, 0, Degrees(-5 * effort * std::cos(turn))}) * ExpSo3({0, Degrees(2 + 2 * effort), 0}),
      {0, 0, 0});
  add(kTorso, torso);
  const Rigid3 head = torso * Rigid3(ExpSo3({0, 0, Degrees(8 * std::sin(0.31 * turn))}), {0.012, 0, 0.605});
  add(kHead, head);
  for (int side = 0; side < 2; ++side) {
    add(kThigh, legs[side].thigh);
    add(kShin, legs[side].shin);
    add(kFoot, legs[side].foot);
    const double sign = side == 0 ? 1 : -1;
    const double swing = -std::cos(turn + std::numbers::pi * side);  // against the leg of its side
    const Rigid3 shoulder(
        ExpSo3({Degrees(sign * 7), 0, 0}) * ExpSo3({0, -Degrees(effort * (22 * swing + 2)), 0}),
        {0, sign * kShoulderHalf, kShoulderUp});
    const Rigid3 upper = torso * shoulder;
    add(kUpperArm, upper);
    add(kForearm, upper * Bend(14 + effort * (12 + 12 * swing), {0, 0, -kUpperArmLength}));
  }
  if (shadows != nullptr) {
    const float c = static_cast<float>(std::cos(state.heading_rad)),
                s = static_cast<float>(std::sin(state.heading_rad));
    shadows->push_back(
        {state.position.cast<float>(), Eigen::Vector2f(c, s) * 0.42f, Eigen::Vector2f(-s, c) * 0.32f});
  }
}

}  // namespace dynamic_slam
