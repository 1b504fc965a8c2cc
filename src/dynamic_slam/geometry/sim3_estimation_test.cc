#include "dynamic_slam/geometry/sim3_estimation.h"

#include <gtest/gtest.h>

#include "dynamic_slam/geometry/two_view_scene.h"

namespace dynamic_slam {
namespace {

constexpr double kNoisePx = 0.5;

const Sim3 kFirstFromSecond{0.7, ExpSo3({0.1, -0.3, 0.05}), {0.4, -0.1, 0.3}};

std::vector<Sim3Match> MakeSim3Matches(int count, int outliers, uint64_t seed) {
  const Camera camera = TestCamera();
  const Sim3 second_from_first = kFirstFromSecond.Inverse();
  Random random(seed);
  std::vector<Sim3Match> matches;
  while (static_cast<int>(matches.size()) < count) {
    Sim3Match match;
    const Eigen::Vector2d px = RandomPixel(camera, random);
    match.x_in_first = random.Uniform(2, 6) * camera.Unproject(px);
    match.x_in_second = second_from_first * match.x_in_first;
    if (!IsSeen(camera, match.x_in_second)) continue;
    match.first_px = px + Noise(kNoisePx, random);
    match.second_px = camera.Project(match.x_in_second) + Noise(kNoisePx, random);
    match.first_sigma_px = match.second_sigma_px = kNoisePx;
    // Depths are less sure than directions.
    match.x_in_first *= 1 + 0.005 * random.Gaussian();
    match.x_in_second *= 1 + 0.005 * random.Gaussian();
    if (static_cast<int>(matches.size()) < outliers) {
      match.second_px = RandomPixel(camera, random);
      match.x_in_second = random.Uniform(1, 8) * camera.Unproject(match.second_px);
    }
    matches.push_back(match);
  }
  return matches;
}

TEST(Sim3EstimationTest, FindsTheSimilarityAmongWrongMatches) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const auto matches = MakeSim3Matches(100, 60, seed);
    Random random(seed);
    const Sim3Estimate estimate = EstimateSim3(TestCamera(), matches, {}, random);
    ASSERT_TRUE(estimate.success);
    EXPECT_NEAR(estimate.first_from_second.scale, kFirstFromSecond.scale, 0.01);
    EXPECT_LT(RotationAngle(estimate.first_from_second.rotation, kFirstFromSecond.rotation), 0.01);
    EXPECT_LT((estimate.first_from_second.translation - kFirstFromSecond.translation).norm(), 0.03);
    EXPECT_GE(estimate.inliers, 30);
    for (size_t i = 0; i < 60; ++i) EXPECT_EQ(estimate.is_inlier[i], 0);
  }
}

TEST(Sim3EstimationTest, DoesNotBelieveMatchesByChance) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const auto matches = MakeSim3Matches(100, 100, seed);
    Random random(seed);
    EXPECT_FALSE(EstimateSim3(TestCamera(), matches, {}, random).success);
  }
}

TEST(Sim3EstimationTest, TooFewMatchesAreNoSuccess) {
  Random random(1);
  EXPECT_FALSE(EstimateSim3(TestCamera(), {}, {}, random).success);
  const auto two = MakeSim3Matches(2, 0, 1);
  EXPECT_FALSE(EstimateSim3(TestCamera(), two, {}, random).success);
}

TEST(Sim3EstimationTest, PointsOnALineAreRefusedWithoutANumber) {
  std::vector<Sim3Match> matches = MakeSim3Matches(30, 0, 1);
  for (size_t i = 0; i < matches.size(); ++i) {
    matches[i].x_in_first = matches[i].x_in_second =
        Eigen::Vector3d(0, 0, 2.0 + 0.1 * static_cast<double>(i));
  }
  Random random(1);
  EXPECT_FALSE(EstimateSim3(TestCamera(), matches, {}, random).success);
}

TEST(Sim3EstimationTest, RefinementComesFromFarOff) {
  const auto matches = MakeSim3Matches(80, 0, 3);
  Sim3 guess = kFirstFromSecond;
  guess.scale *= 1.01;
  guess.translation.x() += 0.01;
  const Sim3Estimate estimate = RefineSim3(TestCamera(), matches, {.chi2 = 100}, guess);
  EXPECT_NEAR(estimate.first_from_second.scale, kFirstFromSecond.scale, 0.005);
  EXPECT_LT((estimate.first_from_second.translation - kFirstFromSecond.translation).norm(), 0.02);
}

// Both cameras are at one place, where no image depends on the scale, and know depths to a tenth.
struct OnePlace {
  explicit OnePlace(uint64_t seed) {
    const Camera camera = TestCamera();
    Random random(seed);
    while (matches.size() < 100) {
      Sim3Match match;
      const Eigen::Vector2d px = RandomPixel(camera, random);
      const Eigen::Vector3d x_in_first = random.Uniform(2, 6) * camera.Unproject(px);
      const Eigen::Vector3d x_in_second = truth.Inverse() * x_in_first;
      if (!IsSeen(camera, x_in_second)) continue;
      match.first_px = px + Noise(kNoisePx, random);
      match.second_px = camera.Project(x_in_second) + Noise(kNoisePx, random);
      match.x_in_first = (1 + 0.1 * random.Gaussian()) * x_in_first;
      match.x_in_second = (1 + 0.1 * random.Gaussian()) * x_in_second;
      matches.push_back(match);
      const Eigen::Vector2d aside_px = camera.Project(aside_from_first * x_in_first);
      sightings.push_back({aside_from_first, x_in_second, aside_px + Noise(kNoisePx, random)});
    }
  }

  Sim3 truth{0.7, ExpSo3({0.1, -0.3, 0.05}), {0, 0, 0}};
  Rigid3 aside_from_first{Eigen::Quaterniond::Identity(), {0.8, 0, 0}};
  std::vector<Sim3Match> matches;
  std::vector<Sim3Sighting> sightings;
};

TEST(Sim3EstimationTest, FromOnePlaceTheDepthsKnowTheScale) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const OnePlace place(seed);
    Random random(seed);
    const Sim3Estimate estimate = EstimateSim3(TestCamera(), place.matches, {}, random);
    ASSERT_TRUE(estimate.success);
    EXPECT_NEAR(estimate.first_from_second.scale, place.truth.scale, 0.05 * place.truth.scale);
  }
}

TEST(Sim3EstimationTest, FromOnePlaceACameraAsideKnowsTheScaleBetter) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const OnePlace place(seed);
    Sim3 guess = place.truth;
    guess.scale *= 1.02;
    const Sim3Estimate estimate = RefineSim3(TestCamera(), place.matches, {}, guess, place.sightings);
    ASSERT_TRUE(estimate.success);
    EXPECT_NEAR(estimate.first_from_second.scale, place.truth.scale, 0.005 * place.truth.scale);
  }
}

TEST(Sim3EstimationTest, TheSameSeedGivesTheSameBits) {
  const auto matches = MakeSim3Matches(100, 60, 5);
  Random first(2), second(2);
  const Sim3Estimate a = EstimateSim3(TestCamera(), matches, {}, first);
  const Sim3Estimate b = EstimateSim3(TestCamera(), matches, {}, second);
  EXPECT_EQ(a.first_from_second.scale, b.first_from_second.scale);
  EXPECT_EQ(a.first_from_second.translation, b.first_from_second.translation);
}

}  // namespace
}  // namespace dynamic_slam
