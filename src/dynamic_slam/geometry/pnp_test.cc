#include "dynamic_slam/geometry/pnp.h"

#include <gtest/gtest.h>

#include "dynamic_slam/geometry/two_view_scene.h"

namespace dynamic_slam {
namespace {

const Rigid3 kCamFromWorld(ExpSo3({0.1, -0.3, 0.2}), {-0.2, 0.3, 0.2});

struct Case {
  Camera camera = TestCamera();
  MatchSet set;
  std::vector<double> sigma_px;
  PnpResult result;

  double rotation_error_deg() const {
    return Degrees(RotationAngle(result.cam_from_world.rotation, kCamFromWorld.rotation));
  }
  double translation_error() const {
    return (result.cam_from_world.translation - kCamFromWorld.translation).norm();
  }
};

Case Solve(int count, double sigma_px, int outliers, uint64_t seed) {
  Case c;
  Random random(seed);
  c.set = MakeMatches(c.camera, kCamFromWorld, count, 0, random,
                      [](const Eigen::Vector2d&, Random& r) { return r.Uniform(1.0, 4.0); });
  for (auto& px : c.set.second_px) px += Noise(sigma_px, random);
  MakeOutliers(c.camera, outliers, random, &c.set);
  c.sigma_px.assign(c.set.second_px.size(), std::max(sigma_px, 0.1));
  c.result = EstimatePnp(c.camera, c.set.points_in_first, c.set.second_px, c.sigma_px, {}, random);
  return c;
}

TEST(Pnp, IsExactForExactMatches) {
  const Case c = Solve(30, 0, 0, 1);
  ASSERT_TRUE(c.result.success);
  EXPECT_EQ(c.result.inliers, 30);
  EXPECT_LT(c.rotation_error_deg(), 1e-6);
  EXPECT_LT(c.translation_error(), 1e-8);
}

TEST(Pnp, SurvivesTwentyPercentInliersOfAHundred) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Case c = Solve(100, 1.0, 80, seed);
    ASSERT_TRUE(c.result.success) << "seed " << seed;
    EXPECT_LT(c.rotation_error_deg(), 0.5) << "seed " << seed;
    EXPECT_LT(c.translation_error(), 0.02) << "seed " << seed;
    int true_inliers = 0;
    for (size_t i = 0; i < c.set.is_true.size(); ++i) {
      true_inliers += c.result.is_inlier[i] && c.set.is_true[i];
    }
    EXPECT_GE(true_inliers, 15) << "seed " << seed;  // of 20, at a test that loses 5%
    EXPECT_LE(c.result.inliers - true_inliers, 2) << "seed " << seed;
  }
}

TEST(Pnp, TrustsPreciseMatchesMore) {
  Random random(4);
  const Camera camera = TestCamera();
  double weighted = 0, unweighted = 0;
  for (int trial = 0; trial < 20; ++trial) {
    MatchSet set = MakeMatches(camera, kCamFromWorld, 60, 0, random,
                               [](const Eigen::Vector2d&, Random& r) { return r.Uniform(1.0, 4.0); });
    std::vector<double> sigma_px(60), equal(60, 4.0);
    for (int i = 0; i < 60; ++i) {
      sigma_px[i] = i < 20 ? 0.3 : 4.0;
      set.second_px[i] += Noise(sigma_px[i], random);
    }
    const auto error = [&](const std::vector<double>& sigmas) {
      const auto result = EstimatePnp(camera, set.points_in_first, set.second_px, sigmas, {}, random);
      EXPECT_TRUE(result.success);
      return RotationAngle(result.cam_from_world.rotation, kCamFromWorld.rotation);
    };
    weighted += error(sigma_px);
    unweighted += error(equal);
  }
  EXPECT_LT(weighted, 0.5 * unweighted);
}

TEST(Pnp, FailsWithoutAPose) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const Case c = Solve(100, 1.0, 100, seed);
    EXPECT_FALSE(c.result.success) << c.result.inliers << " inliers";
    EXPECT_LT(c.result.inliers, 10);
  }
}

TEST(Pnp, FailsOnDegenerateInput) {
  Random random(6);
  const Camera camera = TestCamera();
  EXPECT_FALSE(EstimatePnp(camera, {}, {}, {}, {}, random).success);
  std::vector<Eigen::Vector3d> line;
  std::vector<Eigen::Vector2d> pixels;
  for (int i = 0; i < 20; ++i) {
    line.emplace_back(-1 + 0.1 * i, 0.05 * i, 4);
    pixels.push_back(camera.Project(line.back()));
  }
  const std::vector<double> sigma_px(20, 1.0);
  EXPECT_FALSE(EstimatePnp(camera, line, pixels, sigma_px, {}, random).success);
}

TEST(Pnp, RepeatsItselfForTheSameSeed) {
  const Case a = Solve(100, 1.0, 60, 9), b = Solve(100, 1.0, 60, 9);
  EXPECT_EQ(a.result.cam_from_world.translation, b.result.cam_from_world.translation);
  EXPECT_EQ(a.result.is_inlier, b.result.is_inlier);
}

}  // namespace
}  // namespace dynamic_slam
