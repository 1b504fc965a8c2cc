#include "dynamic_slam/geometry/umeyama.h"

#include <gtest/gtest.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

std::vector<Eigen::Vector3d> RandomPoints(Random& random, int count) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    points.emplace_back(random.Uniform(-3, 3), random.Uniform(-2, 2), random.Uniform(4, 9));
  }
  return points;
}

Sim3 RandomSim3(Random& random) {
  const Eigen::Vector3d axis(random.Gaussian(), random.Gaussian(), random.Gaussian());
  return {random.Uniform(0.1, 5.0), ExpSo3(random.Uniform(0, 3.1) * axis.normalized()),
          Eigen::Vector3d(random.Gaussian(), random.Gaussian(), random.Gaussian())};
}

double SumOfSquares(const Sim3& target_from_source, const std::vector<Eigen::Vector3d>& source,
                    const std::vector<Eigen::Vector3d>& target) {
  double sum = 0;
  for (size_t i = 0; i < source.size(); ++i)
    sum += (target[i] - target_from_source * source[i]).squaredNorm();
  return sum;
}

TEST(Umeyama, RecoversAnExactSimilarity) {
  Random random(1);
  for (int trial = 0; trial < 50; ++trial) {
    const std::vector<Eigen::Vector3d> source = RandomPoints(random, 3 + trial);
    const Sim3 truth = RandomSim3(random);
    std::vector<Eigen::Vector3d> target;
    for (const Eigen::Vector3d& x : source) target.push_back(truth * x);
    const std::optional<Sim3> found = AlignUmeyama(source, target, true);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->scale, truth.scale, 1e-12 * truth.scale);
    EXPECT_LT(RotationAngle(found->rotation, truth.rotation), 1e-11);
    EXPECT_LT((found->translation - truth.translation).norm(), 1e-11);
  }
}

TEST(Umeyama, NoNearbyTransformFitsNoisyPointsBetter) {
  Random random(2);
  const std::vector<Eigen::Vector3d> source = RandomPoints(random, 40);
  const Sim3 truth = RandomSim3(random);
  std::vector<Eigen::Vector3d> target;
  for (const Eigen::Vector3d& x : source) {
    target.push_back(truth * x +
                     0.1 * Eigen::Vector3d(random.Gaussian(), random.Gaussian(), random.Gaussian()));
  }
  for (const bool with_scale : {true, false}) {
    const Sim3 best = AlignUmeyama(source, target, with_scale).value();
    const double smallest = SumOfSquares(best, source, target);
    for (int trial = 0; trial < 100; ++trial) {
      const Eigen::Vector3d turn(random.Gaussian(), random.Gaussian(), random.Gaussian());
      const Eigen::Vector3d shift(random.Gaussian(), random.Gaussian(), random.Gaussian());
      Sim3 other = best;
      other.rotation = ExpSo3(1e-3 * turn) * best.rotation;
      other.translation += 1e-3 * shift;
      if (with_scale) other.scale *= 1.0 + 1e-3 * random.Gaussian();
      EXPECT_GT(SumOfSquares(other, source, target), smallest);
    }
  }
}

TEST(Umeyama, WithoutScaleTheScaleIsOne) {
  Random random(3);
  const std::vector<Eigen::Vector3d> source = RandomPoints(random, 10);
  std::vector<Eigen::Vector3d> target;
  for (const Eigen::Vector3d& x : source) target.push_back(2.0 * x);
  EXPECT_EQ(AlignUmeyama(source, target, false)->scale, 1.0);
}

TEST(Umeyama, AMirrorImageStillGivesARotation) {
  Random random(4);
  const std::vector<Eigen::Vector3d> source = RandomPoints(random, 20);
  std::vector<Eigen::Vector3d> target;
  for (const Eigen::Vector3d& x : source) target.emplace_back(-x.x(), x.y(), x.z());
  const Sim3 found = AlignUmeyama(source, target, true).value();
  EXPECT_NEAR(found.rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
  EXPECT_GT(found.scale, 0);
}

TEST(Umeyama, PointsInAPlaneAreEnough) {
  const std::vector<Eigen::Vector3d> source{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}};
  const Sim3 truth{1.5, ExpSo3({0.3, -0.2, 0.9}), {1, 2, 3}};
  std::vector<Eigen::Vector3d> target;
  for (const Eigen::Vector3d& x : source) target.push_back(truth * x);
  const Sim3 found = AlignUmeyama(source, target, true).value();
  EXPECT_LT(RotationAngle(found.rotation, truth.rotation), 1e-12);
}

TEST(Umeyama, RefusesWhatDoesNotDetermineARotation) {
  const std::vector<Eigen::Vector3d> line{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {5, 5, 5}};
  const std::vector<Eigen::Vector3d> still(4, Eigen::Vector3d(1, 2, 3));
  const std::vector<Eigen::Vector3d> two{{0, 0, 0}, {1, 0, 0}};
  EXPECT_FALSE(AlignUmeyama(line, line, true));
  EXPECT_FALSE(AlignUmeyama(still, still, true));
  EXPECT_FALSE(AlignUmeyama(two, two, true));
  EXPECT_FALSE(AlignUmeyama({}, {}, true));
  EXPECT_THROW(AlignUmeyama(line, two, true), InternalError);
}

}  // namespace
}  // namespace dynamic_slam
