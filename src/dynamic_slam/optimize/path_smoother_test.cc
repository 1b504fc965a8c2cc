#include "dynamic_slam/optimize/path_smoother.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "dynamic_slam/base/random.h"

namespace dynamic_slam {
namespace {

constexpr int kFrames = 300;
constexpr double kFps = 30;

// A hand: slow swings about three axes, 1 Hz and less.
Rigid3 HandAt(double t) {
  return {ExpSo3({0.2 * std::sin(3 * t), 0.5 * std::sin(1.3 * t), 0.1 * std::sin(5 * t)}),
          {0.5 * std::sin(1.1 * t), 0.1 * std::sin(4 * t), 0.3 * std::sin(2 * t)}};
}

std::vector<StampedPose> Path(const std::function<Rigid3(double)>& at, double noise, uint64_t seed = 1) {
  Random random(seed);
  std::vector<StampedPose> path;
  for (int i = 0; i < kFrames; ++i) {
    const double t = i / kFps;
    const auto vector = [&] {
      return Eigen::Vector3d(random.Gaussian(), random.Gaussian(), random.Gaussian());
    };
    const Rigid3 pose = at(t);
    path.push_back(
        {t, Rigid3(ExpSo3(noise * vector()) * pose.rotation, pose.translation + noise * vector())});
  }
  return path;
}

struct Errors {
  double position = 0, angle_rad = 0, most_position = 0;
};

Errors ErrorsOf(const std::vector<StampedPose>& path, const std::vector<Rigid3>& poses,
                const std::function<Rigid3(double)>& at) {
  Errors errors;
  for (size_t i = 0; i < path.size(); ++i) {
    const Rigid3 truth = at(path[i].timestamp_s);
    const double away = (poses[i].translation - truth.translation).norm();
    errors.position += away * away;
    errors.angle_rad += std::pow(poses[i].rotation.angularDistance(truth.rotation), 2);
    if (!(away <= errors.most_position)) errors.most_position = away;  // so that NaN is not lost
  }
  const auto n = static_cast<double>(path.size());
  return {std::sqrt(errors.position / n), std::sqrt(errors.angle_rad / n), errors.most_position};
}

std::vector<Rigid3> Unsmoothed(const std::vector<StampedPose>& path) {
  std::vector<Rigid3> poses;
  for (const StampedPose& pose : path) poses.push_back(pose.world_from_cam);
  return poses;
}

TEST(PathSmootherTest, TakesNoiseAway) {
  const std::vector<StampedPose> path = Path(HandAt, 0.005);
  const Errors before = ErrorsOf(path, Unsmoothed(path), HandAt),
               after = ErrorsOf(path, SmoothPath(path), HandAt);
  EXPECT_LT(after.position, 0.5 * before.position);
  EXPECT_LT(after.angle_rad, 0.6 * before.angle_rad);
}

TEST(PathSmootherTest, ExactPosesStay) {
  const std::vector<StampedPose> path = Path(HandAt, 0);
  const Errors after = ErrorsOf(path, SmoothPath(path), HandAt);
  EXPECT_LT(after.most_position, 1e-5);
  EXPECT_LT(after.angle_rad, 1e-5);
}

TEST(PathSmootherTest, TheUnitOfLengthDoesNotMatter) {
  std::vector<StampedPose> path = Path(HandAt, 0.005);
  const std::vector<Rigid3> smooth = SmoothPath(path);
  for (StampedPose& pose : path) pose.world_from_cam.translation *= 1000;
  const std::vector<Rigid3> long_smooth = SmoothPath(path);
  for (size_t i = 0; i < path.size(); ++i)
    EXPECT_LT((long_smooth[i].translation / 1000 - smooth[i].translation).norm(), 1e-9);
}

TEST(PathSmootherTest, OneWrongPoseDoesNotBendThePath) {
  std::vector<StampedPose> path = Path(HandAt, 0.001);
  const size_t wrong = kFrames / 2;
  path[wrong].world_from_cam.translation.x() += 0.1;
  const std::vector<Rigid3> smooth = SmoothPath(path);
  for (size_t i = wrong - 3; i <= wrong + 3; ++i)
    EXPECT_LT((smooth[i].translation - HandAt(path[i].timestamp_s).translation).norm(), 0.006) << i - wrong;
}

// A robot that drives straight, and from one frame to the next to the left.
TEST(PathSmootherTest, CornersAreNotCut) {
  const auto robot = [](double t) {
    return Rigid3(Eigen::Quaterniond::Identity(), {0.5 * std::min(t, 5.0), 0.5 * std::max(t - 5.0, 0.0), 0});
  };
  const std::vector<StampedPose> path = Path(robot, 0.001);
  const Errors before = ErrorsOf(path, Unsmoothed(path), robot),
               after = ErrorsOf(path, SmoothPath(path), robot);
  EXPECT_LT(after.position, 0.7 * before.position);
  EXPECT_LT(after.most_position, 0.006);
}

TEST(PathSmootherTest, AGapIsNotBridged) {
  // It was carried elsewhere in the meantime.
  for (const double gap_s : {0.0, 5.0, 1e6}) {
    std::vector<StampedPose> path = Path(HandAt, 0.003);
    for (size_t i = kFrames / 2; i < kFrames; ++i) {
      path[i].timestamp_s += gap_s;
      path[i].world_from_cam.translation.x() += 4;
    }
    const auto moved = [gap_s](double t) {
      const bool is_before = t < 0.5 * kFrames / kFps;
      Rigid3 pose = HandAt(is_before ? t : t - gap_s);
      if (!is_before) pose.translation.x() += 4;
      return pose;
    };
    const Errors before = ErrorsOf(path, Unsmoothed(path), moved),
                 after = ErrorsOf(path, SmoothPath(path), moved);
    EXPECT_LT(after.position, 0.6 * before.position) << gap_s;
    EXPECT_LT(after.most_position, 0.01) << gap_s;
  }
}

TEST(PathSmootherTest, AtRestThePoseIsTheMean) {
  const auto still = [](double) { return Rigid3(); };
  const std::vector<StampedPose> path = Path(still, 0.005);
  EXPECT_LT(ErrorsOf(path, SmoothPath(path), still).most_position, 0.003);
  const std::vector<StampedPose> exact = Path(still, 0);
  EXPECT_EQ(ErrorsOf(exact, SmoothPath(exact), still).most_position, 0);
}

TEST(PathSmootherTest, AFewPosesStayAsTheyAreAndEqualStampsAreNoTrouble) {
  std::vector<StampedPose> path = Path(HandAt, 0.01);
  std::vector<StampedPose> few(path.begin(), path.begin() + 9);
  EXPECT_EQ(SmoothPath(few)[4].translation, few[4].world_from_cam.translation);
  EXPECT_TRUE(SmoothPath({}).empty());
  path[50].timestamp_s = path[49].timestamp_s;
  EXPECT_LT(ErrorsOf(path, SmoothPath(path), HandAt).most_position, 0.05);
}

TEST(AccelerationNoiseTest, IsThatOfTheSimulatedPath) {
  constexpr double kNoise = 0.04, kDt = 1 / kFps;  // m^2/s^3
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    Random random(seed);
    Eigen::Vector3d position = Eigen::Vector3d::Zero(), velocity = Eigen::Vector3d::Zero();
    std::vector<StampedPose> path;
    for (int i = 0; i < kFrames; ++i) {
      const auto vector = [&] {
        return Eigen::Vector3d(random.Gaussian(), random.Gaussian(), random.Gaussian());
      };
      // White noise of acceleration over a step: of the velocity, and of the position beside what that tells.
      const Eigen::Vector3d push = std::sqrt(kNoise * kDt) * vector();
      position += kDt * (velocity + 0.5 * push) + std::sqrt(kNoise * kDt * kDt * kDt / 12) * vector();
      velocity += push;
      path.push_back({i * kDt, Rigid3(Eigen::Quaterniond::Identity(), position + 0.001 * vector())});
    }
    EXPECT_GT(AccelerationNoise(path), 0.5 * kNoise);
    EXPECT_LT(AccelerationNoise(path), 2 * kNoise);
    EXPECT_NEAR(std::sqrt(PositionVariance(path)), 0.001, 0.0003);
  }
}

TEST(AccelerationNoiseTest, IsNotKnownOfFewPosesOrOfACameraThatStands) {
  const std::vector<StampedPose> path = Path(HandAt, 0.001);
  EXPECT_EQ(AccelerationNoise(std::span(path).first(19)), 0);
  EXPECT_EQ(PositionVariance(std::span(path).first(19)), 0);
  EXPECT_EQ(AccelerationNoise(Path([](double) { return Rigid3(); }, 0)), 0);
}

TEST(ShotsOfTest, AreBetweenTheCuts) {
  const auto cut_at_4_s = [](double t) {
    Rigid3 pose = HandAt(t);
    if (t >= 4) pose.translation.x() += 10;
    return pose;
  };
  const std::vector<StampedPose> path = Path(cut_at_4_s, 0.001), whole = Path(HandAt, 0.001);
  const auto shots = ShotsOf(path);
  ASSERT_EQ(shots.size(), 2u);
  EXPECT_EQ(shots[0].size(), 4 * kFps);
  EXPECT_EQ(shots[0].size() + shots[1].size(), path.size());
  EXPECT_EQ(ShotsOf(whole).size(), 1u);
}

}  // namespace
}  // namespace dynamic_slam
