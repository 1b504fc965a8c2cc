#include "dynamic_slam/geometry/two_view.h"

#include <algorithm>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "dynamic_slam/geometry/triangulation.h"
#include "dynamic_slam/geometry/two_view_scene.h"

namespace dynamic_slam {
namespace {

constexpr int kSeeds = 20;
const Rigid3 kSideways(ExpSo3({0.01, -0.03, 0.02}), {-0.2, 0.03, 0.02});

double UniformDepth(const Eigen::Vector2d&, Random& random) { return random.Uniform(1.0, 4.0); }

struct Errors {
  int successes = 0, from_homography = 0;
  std::vector<double> rotation_deg, translation_deg, wrong_ratio;
  std::vector<TwoViewFailure> failures;

  static double Max(const std::vector<double>& v) {
    return v.empty() ? 0 : *std::max_element(v.begin(), v.end());
  }
  static double Median(std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v.empty() ? 0 : v[v.size() / 2];
  }
};

Errors RunSeeds(const Camera& camera, const Rigid3& truth, const std::function<MatchSet(Random&)>& make) {
  Errors errors;
  for (int seed = 0; seed < kSeeds; ++seed) {
    Random random(1000 + 17 * seed);
    const MatchSet set = make(random);
    const TwoViewResult result = EstimateTwoView(camera, set.first_px, set.second_px, {}, random);
    errors.failures.push_back(result.failure);
    errors.from_homography += result.from_homography;
    if (!result.Succeeded()) continue;
    ++errors.successes;
    errors.rotation_deg.push_back(
        Degrees(RotationAngle(result.motion.second_from_first.rotation, truth.rotation)));
    errors.translation_deg.push_back(
        Degrees(ParallaxAngle(result.motion.second_from_first.translation, truth.translation)));
    EXPECT_NEAR(result.motion.second_from_first.translation.norm(), 1, 1e-12);
    int points = 0, wrong = 0;
    for (size_t i = 0; i < set.is_true.size(); ++i) {
      points += result.motion.is_inlier[i];
      wrong += result.motion.is_inlier[i] && !set.is_true[i];
    }
    errors.wrong_ratio.push_back(static_cast<double>(wrong) / points);
  }
  return errors;
}

TEST(TwoView, IsExactForExactMatches) {
  const Camera camera = TestCamera();
  Random random(1);
  const MatchSet set = MakeMatches(camera, kSideways, 300, 0, random, UniformDepth);
  const TwoViewResult result = EstimateTwoView(camera, set.first_px, set.second_px, {}, random);
  ASSERT_TRUE(result.Succeeded()) << Explain(result);
  EXPECT_FALSE(result.from_homography);
  EXPECT_EQ(result.inliers, 300);
  EXPECT_LT(RotationAngle(result.motion.second_from_first.rotation, kSideways.rotation), 1e-6);
  const double scale = kSideways.translation.norm();
  for (size_t i = 0; i < set.points_in_first.size(); ++i) {
    ASSERT_TRUE(result.motion.is_inlier[i]);
    EXPECT_LT((scale * result.motion.points_in_first[i] - set.points_in_first[i]).norm(), 1e-3);
  }
}

TEST(TwoView, GeneralSceneWithNoise) {
  const Camera camera = TestCamera();
  for (const double sigma_px : {0.5, 1.0}) {
    const Errors e = RunSeeds(camera, kSideways, [&](Random& random) {
      return MakeMatches(camera, kSideways, 500, sigma_px, random, UniformDepth);
    });
    EXPECT_EQ(e.successes, kSeeds);
    EXPECT_EQ(e.from_homography, 0);
    EXPECT_LT(Errors::Median(e.rotation_deg), 0.1 * sigma_px);
    EXPECT_LT(Errors::Max(e.rotation_deg), 0.4 * sigma_px);
    EXPECT_LT(Errors::Median(e.translation_deg), 0.5 * sigma_px);
    EXPECT_LT(Errors::Max(e.translation_deg), 1.2 * sigma_px);
  }
}

TEST(TwoView, OutliersUpToHalf) {
  const Camera camera = TestCamera();
  for (const int outliers : {150, 200, 250}) {
    const Errors e = RunSeeds(camera, kSideways, [&](Random& random) {
      MatchSet set = MakeMatches(camera, kSideways, 500, 0.7, random, UniformDepth);
      MakeOutliers(camera, outliers, random, &set);
      return set;
    });
    EXPECT_EQ(e.successes, kSeeds);
    EXPECT_LT(Errors::Median(e.rotation_deg), 0.15);
    EXPECT_LT(Errors::Max(e.rotation_deg), 0.5);
    EXPECT_LT(Errors::Median(e.translation_deg), 0.7);
    EXPECT_LT(Errors::Max(e.translation_deg), 2.0);
    EXPECT_LT(Errors::Max(e.wrong_ratio), 0.04);
  }
}

TEST(TwoView, MovingThingsDoNotSetTheMotion) {
  const Camera camera = TestCamera();
  const Rigid3 object_motion(ExpSo3({0.0, 0.1, 0.0}), {-0.05, 0.15, 0.1});
  const Errors e = RunSeeds(camera, kSideways, [&](Random& random) {
    MatchSet set = MakeMatches(camera, kSideways, 500, 0.7, random, UniformDepth);
    const MatchSet moving =
        MakeMatches(camera, kSideways * object_motion, 150, 0.7, random,
                    [](const Eigen::Vector2d&, Random& r) { return r.Uniform(1.5, 2.0); });
    for (size_t i = 0; i < moving.first_px.size(); ++i) {
      set.first_px[i] = moving.first_px[i];
      set.second_px[i] = moving.second_px[i];
      set.is_true[i] = 0;
    }
    return set;
  });
  EXPECT_EQ(e.successes, kSeeds);
  EXPECT_LT(Errors::Max(e.rotation_deg), 0.4);
  EXPECT_LT(Errors::Max(e.translation_deg), 1.2);
  EXPECT_LT(Errors::Max(e.wrong_ratio), 0.03);
}

TEST(TwoView, PlaneIsRecognisedAndItsMotionFound) {
  const Camera camera = TestCamera();
  const Rigid3 truth(ExpSo3({0.02, -0.1, 0.02}), {-0.4, 0.1, 0.05});
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.5, -1).normalized();
  for (const int outliers : {0, 150}) {
    const Errors e = RunSeeds(camera, truth, [&](Random& random) {
      MatchSet set = MakeMatches(camera, truth, 500, 0.5, random, [&](const Eigen::Vector2d& px, Random&) {
        return -1.6 / normal.dot(camera.Unproject(px));
      });
      MakeOutliers(camera, outliers, random, &set);
      return set;
    });
    EXPECT_EQ(e.from_homography, kSeeds);
    EXPECT_GE(e.successes, kSeeds * 4 / 5);
    for (const TwoViewFailure failure : e.failures) {
      EXPECT_THAT(failure, testing::AnyOf(TwoViewFailure::kNone, TwoViewFailure::kAmbiguous));
    }
    EXPECT_LT(Errors::Max(e.rotation_deg), 0.6);
    EXPECT_LT(Errors::Max(e.translation_deg), 2.5);
  }
}

TEST(TwoView, CloseToAPlaneTheTruthIsAlwaysAmongTheMotions) {
  const Camera camera = TestCamera();
  const Rigid3 truth(ExpSo3({0.02, -0.1, 0.02}), Eigen::Vector3d(-0.2, 0.05, 0.02));
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.5, -1).normalized();
  for (int seed = 0; seed < 100; ++seed) {
    Random random(1000 + 17 * seed);
    const MatchSet set =
        MakeMatches(camera, truth, 300, 0.7, random, [&](const Eigen::Vector2d& px, Random& r) {
          return -1.6 / normal.dot(camera.Unproject(px)) * (1 + 0.05 * r.Uniform(-1, 1));
        });
    const TwoViewResult result = EstimateTwoView(camera, set.first_px, set.second_px, {}, random);
    ASSERT_TRUE(result.Succeeded() || result.failure == TwoViewFailure::kAmbiguous) << Explain(result);
    double nearest_deg = 180;
    const auto compare = [&](const TwoViewMotion& motion) {
      nearest_deg = std::min(nearest_deg,
                             Degrees(ParallaxAngle(motion.second_from_first.translation, truth.translation)));
    };
    compare(result.motion);
    for (const TwoViewMotion& rival : result.rivals) compare(rival);
    EXPECT_LT(nearest_deg, 12) << seed << ": " << Explain(result) << ", " << result.rivals.size()
                               << " rivals";
  }
}

TEST(TwoView, ForwardMotionOfACar) {
  const Camera camera = TestCarCamera();
  const Rigid3 truth(ExpSo3({0.002, -0.01, 0.001}), {0.02, 0.01, -1.5});
  const Errors e = RunSeeds(camera, truth, [&](Random& random) {
    MatchSet set = MakeMatches(camera, truth, 800, 0.6, random, [&](const Eigen::Vector2d& px, Random& r) {
      const Eigen::Vector3d ray = camera.Unproject(px);  // a street between houses
      double depth = r.Uniform(8, 50);
      if (ray.y() > 0.02) depth = std::min(depth, 1.65 / ray.y());
      if (std::abs(ray.x()) > 0.05) depth = std::min(depth, r.Uniform(5, 9) / std::abs(ray.x()));
      return depth;
    });
    MakeOutliers(camera, 240, random, &set);
    return set;
  });
  EXPECT_EQ(e.successes, kSeeds);
  EXPECT_LT(Errors::Max(e.rotation_deg), 0.1);
  EXPECT_LT(Errors::Max(e.translation_deg), 0.8);
}

TEST(TwoView, PureRotationNeverSucceeds) {
  const Camera camera = TestCamera();
  const Rigid3 turn(ExpSo3({0.02, -0.08, 0.02}), Eigen::Vector3d::Zero());
  for (const double sigma_px : {0.0, 0.5, 1.0}) {
    for (const int outliers : {0, 150}) {
      const Errors e = RunSeeds(camera, turn, [&](Random& random) {
        MatchSet set = MakeMatches(camera, turn, 500, sigma_px, random, UniformDepth);
        MakeOutliers(camera, outliers, random, &set);
        return set;
      });
      EXPECT_THAT(e.failures, testing::Each(TwoViewFailure::kLowParallax));
    }
  }
}

TEST(TwoView, RefusalsSayWhyWithNumbers) {
  const Camera camera = TestCamera();
  Random random(3);
  MatchSet set = MakeMatches(camera, kSideways, 40, 0.5, random, UniformDepth);
  TwoViewResult result = EstimateTwoView(camera, set.first_px, set.second_px, {}, random);
  EXPECT_EQ(result.failure, TwoViewFailure::kTooFewMatches);
  EXPECT_EQ(Explain(result), "40 matches < 50; point the camera at texture");

  set = MakeMatches(camera, kSideways, 200, 0.5, random, UniformDepth);
  MakeOutliers(camera, 180, random, &set);
  result = EstimateTwoView(camera, set.first_px, set.second_px, {}, random);
  EXPECT_EQ(result.failure, TwoViewFailure::kTooFewInliers) << Explain(result);
  EXPECT_LT(result.value, 50);

  const Rigid3 small(kSideways.rotation, 0.1 * kSideways.translation);
  set = MakeMatches(camera, small, 300, 0.3, random, UniformDepth);
  TwoViewOptions options;
  options.min_parallax_deg = 1.0;
  result = EstimateTwoView(camera, set.first_px, set.second_px, options, random);
  EXPECT_EQ(result.failure, TwoViewFailure::kLowParallax);
  EXPECT_GT(result.value, 0.2);
  EXPECT_LT(result.value, 1.0);
  EXPECT_THAT(Explain(result), testing::MatchesRegex("parallax 0\\.[0-9] deg < 1\\.0 deg; move sideways"));
  EXPECT_THAT(result.motion.is_inlier, testing::Each(0));
}

TEST(TwoView, RepeatsItselfForTheSameSeed) {
  const Camera camera = TestCamera();
  Random random(4);
  MatchSet set = MakeMatches(camera, kSideways, 300, 1.0, random, UniformDepth);
  MakeOutliers(camera, 100, random, &set);
  Random a(7), b(7);
  const TwoViewResult first = EstimateTwoView(camera, set.first_px, set.second_px, {}, a);
  const TwoViewResult second = EstimateTwoView(camera, set.first_px, set.second_px, {}, b);
  EXPECT_EQ(first.motion.second_from_first.translation, second.motion.second_from_first.translation);
  EXPECT_EQ(first.motion.is_inlier, second.motion.is_inlier);
}

}  // namespace
}  // namespace dynamic_slam
