#include "dynamic_slam/tracking/rest_flow.h"

#include <cmath>

#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

// A camera that rolls, advances and turns aside, and points at rest in the left third of the image.
struct Scene {
  Eigen::Matrix2d linear;
  Eigen::Vector2d shift{12, -7};
  std::vector<PointMotion> motions;

  explicit Scene(double noise_px, int count = 60) {
    const double zoom = 1.02, roll = 0.03;
    linear << zoom * std::cos(roll), -zoom * std::sin(roll), zoom * std::sin(roll), zoom * std::cos(roll);
    Random random(3);
    const auto uniform = [&] { return static_cast<double>(random.Next() % 10000) / 10000; };
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector2d from(200 * uniform(), 480 * uniform());
      const Eigen::Vector2d noise(uniform() - 0.5, uniform() - 0.5);
      motions.push_back({from, Move(from) + 2 * noise_px * noise});
    }
  }

  Eigen::Vector2d Move(const Eigen::Vector2d& px) const { return linear * px + shift; }
};

TEST(RestFlowTest, FindsTheSimilarityAndSaysHowSureItIs) {
  const Scene scene(1.0);
  const auto flow = RestFlow::Fit(scene.motions);
  ASSERT_TRUE(flow.has_value());
  const Eigen::Vector2d near(100, 240), far(600, 240);
  EXPECT_LT((flow->Move(near) - scene.Move(near)).norm(), 0.5);
  EXPECT_LT((flow->Move(far) - scene.Move(far)).norm(), 3 * std::sqrt(flow->Variance(far)));
  EXPECT_GT(flow->Variance(far), flow->Variance(near));
}

TEST(RestFlowTest, BearsAThirdThatMovesOtherwise) {
  Scene scene(0.5);
  for (int i = 0; i < 25; ++i) {
    const Eigen::Vector2d from(300.0 + 7 * i, 100.0 + 11 * i);
    scene.motions.push_back({from, scene.Move(from) + Eigen::Vector2d(-20, 4)});
  }
  const auto flow = RestFlow::Fit(scene.motions);
  ASSERT_TRUE(flow.has_value());
  EXPECT_LT((flow->Move({100, 240}) - scene.Move({100, 240})).norm(), 0.5);
}

TEST(RestFlowTest, FewOrDiscordantMotionsSayNothing) {
  EXPECT_FALSE(RestFlow::Fit(Scene(0.5, 5).motions).has_value());
  EXPECT_FALSE(RestFlow::Fit(Scene(60, 40).motions).has_value());
}

}  // namespace
}  // namespace dynamic_slam
