#include "dynamic_slam/optimize/path_smoother.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {
namespace {

constexpr size_t kFewest = 10;

// Of 600 simulated paths of so many poses, none had a noise of acceleration that was found less than a tenth
// of what it was; of as many of 10 poses, one in fifty had next to none.
constexpr size_t kFewestForNoise = 20;

// Degrees of freedom of Student's distribution: heavy tails that still have a variance.
constexpr double kDegrees = 4;

constexpr int kReweightings = 5;

// A step so many times as fast as any of so many before and after it is none that a camera made: the film was
// cut. A wrong pose makes two such steps.
constexpr double kCutRatio = 5;
constexpr size_t kCutSteps = 3;

// Two images at one time are a moment apart.
constexpr double kMinStep_s = 1e-6;

// The noise of acceleration over that of a pose, 1/s^3: from a camera that stands for minutes to poses that
// are exact.
constexpr double kLeastRatio = 1e-3, kMostRatio = 1e12;

// Smooths points of D coordinates; the noise of one is of variance 1 until the path says how long that is.
template <int D>
class PointSmoother {
 public:
  using Point = Eigen::Matrix<double, D, 1>;

  PointSmoother(const std::vector<double>& stamps_s, std::vector<Point> points)
      : points_(std::move(points)), steps_(points_.size()) {
    for (size_t i = 1; i < points_.size(); ++i)
      steps_[i].dt_s = std::max(stamps_s[i] - stamps_s[i - 1], kMinStep_s);
  }

  std::vector<Point> Smooth() {
    double ratio = 1;
    ChooseRatio(kLeastRatio, kMostRatio, 10, &ratio);
    for (int i = 0; i <= kReweightings; ++i) {
      ChooseRatio(std::max(ratio / 4, kLeastRatio), std::min(ratio * 4, kMostRatio), 2, &ratio);
      Filter(ratio);
      if (!(variance_ > 0)) return points_;  // it stands, exactly
      SmoothBack();
      if (i < kReweightings) Reweight(ratio);
    }
    ratio_ = ratio;
    std::vector<Point> smooth;
    for (const Step& step : steps_) smooth.push_back(step.state.row(0).transpose());
    return smooth;
  }

  // After Smooth().
  double MotionNoise() const { return ratio_ * variance_; }
  double PointVariance() const { return variance_; }

 private:
  using State = Eigen::Matrix<double, 2, D>;  // the point, and its speed

  struct Step {
    double dt_s = 0;                       // since the one before
    double weight = 1, motion_weight = 1;  // of the point, and of the motion to it
    State predicted = State::Zero(), state = State::Zero();
    Eigen::Matrix2d predicted_covariance = Eigen::Matrix2d::Zero(), covariance = Eigen::Matrix2d::Zero();
  };

  static Eigen::Matrix2d Transition(const Step& step) {
    return (Eigen::Matrix2d() << 1, step.dt_s, 0, 1).finished();
  }
  static Eigen::Matrix2d MotionCovariance(const Step& step) {
    const double dt = step.dt_s;
    return (Eigen::Matrix2d() << dt * dt * dt / 3, dt * dt / 2, dt * dt / 2, dt).finished();
  }

  void ChooseRatio(double least, double most, double factor, double* ratio) {
    double best = -std::numeric_limits<double>::infinity();
    for (double r = least; r <= most * 1.001; r *= factor) {
      const double log_likelihood = Filter(r);
      if (log_likelihood <= best) continue;
      best = log_likelihood;
      *ratio = r;
    }
  }

  // Forwards. Returns the logarithm of the likelihood of the points, of the variance that makes it greatest.
  double Filter(double ratio) {
    double squares = 0, log_determinants = 0;
    for (size_t i = 0; i < steps_.size(); ++i) {
      Step& step = steps_[i];
      if (i == 0) {
        // Next to nothing is known of the first one.
        const double dt = steps_[1].dt_s;
        step.predicted << points_[0].transpose(), (points_[1] - points_[0]).transpose() / dt;
        step.predicted_covariance << 100, 0, 0, 20 / (dt * dt);
      } else {
        const Eigen::Matrix2d F = Transition(step);
        step.predicted = F * steps_[i - 1].state;
        step.predicted_covariance = F * steps_[i - 1].covariance * F.transpose() +
                                    ratio / step.motion_weight * MotionCovariance(step);
      }
      const Eigen::Matrix2d& P = step.predicted_covariance;
      const double noise = 1 / step.weight, variance = P(0, 0) + noise;
      const Point innovation = points_[i] - step.predicted.row(0).transpose();
      step.state = step.predicted + P.col(0) / variance * innovation.transpose();
      // As differences only where these are not small: after hours without a pose P is huge.
      const double share = noise / variance;
      step.covariance << share * P(0, 0), share * P(0, 1), share * P(1, 0),
          P(1, 1) - P(0, 1) / variance * P(1, 0);
      if (i < 2) continue;  // they make the state
      squares += innovation.squaredNorm() / variance;
      log_determinants += std::log(variance);
    }
    const auto numbers = static_cast<double>(D * (steps_.size() - 2));
    variance_ = squares / numbers;
    return -0.5 * (numbers * std::log(variance_) + D * log_determinants);
  }

  void SmoothBack() {
    for (size_t i = steps_.size() - 1; i-- > 0;) {
      const Step& next = steps_[i + 1];
      const Eigen::Matrix2d gain =
          steps_[i].covariance * Transition(next).transpose() * next.predicted_covariance.inverse();
      steps_[i].state += gain * (next.state - next.predicted);
    }
  }

  void Reweight(double ratio) {
    double sum = 0, motion_sum = 0;
    for (size_t i = 0; i < steps_.size(); ++i) {
      Step& step = steps_[i];
      const double squared_error = (points_[i] - step.state.row(0).transpose()).squaredNorm() / variance_;
      step.weight = (kDegrees + D) / (kDegrees + squared_error);
      sum += step.weight;
      if (i == 0) continue;
      const State jolt = step.state - Transition(step) * steps_[i - 1].state;
      const double squared_jolt =
          (jolt.transpose() * MotionCovariance(step).inverse() * jolt).trace() / (ratio * variance_);
      step.motion_weight = (kDegrees + 2 * D) / (kDegrees + squared_jolt);
      motion_sum += step.motion_weight;
    }
    const auto n = static_cast<double>(steps_.size());
    for (Step& step : steps_) {
      step.weight *= n / sum;
      step.motion_weight *= (n - 1) / motion_sum;
    }
  }

  std::vector<Point> points_;
  std::vector<Step> steps_;
  double variance_ = 0;  // of the noise of a point, in each coordinate
  double ratio_ = 0;     // of the noise of acceleration over that
};

// Whether the film was cut before the pose, which has kCutSteps steps before and after that one.
bool IsCut(std::span<const StampedPose> poses, size_t i) {
  const auto speeds = [&](size_t k) {
    const Rigid3 &from = poses[k - 1].world_from_cam, &to = poses[k].world_from_cam;
    const double dt_s = std::max(poses[k].timestamp_s - poses[k - 1].timestamp_s, kMinStep_s);
    return std::pair((to.translation - from.translation).norm() / dt_s,
                     to.rotation.angularDistance(from.rotation) / dt_s);
  };
  double fastest = 0, fastest_turn = 0;
  for (size_t k = i - kCutSteps; k <= i + kCutSteps; ++k) {
    if (k == i) continue;
    const auto [speed, turn] = speeds(k);
    fastest = std::max(fastest, speed);
    fastest_turn = std::max(fastest_turn, turn);
  }
  const auto [speed, turn] = speeds(i);
  return speed > kCutRatio * fastest || turn > kCutRatio * fastest_turn;
}

std::vector<double> StampsOf(std::span<const StampedPose> poses) {
  std::vector<double> stamps_s;
  for (const StampedPose& pose : poses) stamps_s.push_back(pose.timestamp_s);
  return stamps_s;
}

std::vector<Eigen::Vector3d> PositionsOf(std::span<const StampedPose> poses) {
  std::vector<Eigen::Vector3d> positions;
  for (const StampedPose& pose : poses) positions.push_back(pose.world_from_cam.translation);
  return positions;
}

PointSmoother<3> SmoothedPositions(std::span<const StampedPose> poses) {
  PointSmoother<3> smoother(StampsOf(poses), PositionsOf(poses));
  smoother.Smooth();
  return smoother;
}

// Without cuts.
void SmoothShot(std::span<const StampedPose> poses, std::vector<Rigid3>* smooth) {
  const size_t first = smooth->size();
  for (const StampedPose& pose : poses) smooth->push_back(pose.world_from_cam);
  if (poses.size() < kFewest) return;
  const std::vector<double> stamps_s = StampsOf(poses);
  std::vector<Eigen::Vector4d> orientations;  // of a quaternion and its negative, the nearer to the last
  for (const StampedPose& pose : poses) {
    const Eigen::Vector4d q = pose.world_from_cam.rotation.coeffs();
    orientations.push_back(!orientations.empty() && q.dot(orientations.back()) < 0 ? Eigen::Vector4d(-q) : q);
  }
  const std::vector<Eigen::Vector3d> positions = PointSmoother<3>(stamps_s, PositionsOf(poses)).Smooth();
  orientations = PointSmoother<4>(stamps_s, std::move(orientations)).Smooth();
  for (size_t i = 0; i < poses.size(); ++i)
    (*smooth)[first + i] = Rigid3(Eigen::Quaterniond(orientations[i]), positions[i]);
}

}  // namespace

std::vector<std::span<const StampedPose>> ShotsOf(std::span<const StampedPose> poses) {
  std::vector<std::span<const StampedPose>> shots;
  for (size_t begin = 0, end = 0; begin < poses.size(); begin = end) {
    end = begin + 1;
    while (end < poses.size() && (end <= kCutSteps || end + kCutSteps >= poses.size() || !IsCut(poses, end)))
      ++end;
    shots.push_back(poses.subspan(begin, end - begin));
  }
  return shots;
}

double AccelerationNoise(std::span<const StampedPose> poses) {
  return poses.size() < kFewestForNoise ? 0 : SmoothedPositions(poses).MotionNoise();
}

double PositionVariance(std::span<const StampedPose> poses) {
  return poses.size() < kFewestForNoise ? 0 : SmoothedPositions(poses).PointVariance();
}

std::vector<Rigid3> SmoothPath(std::span<const StampedPose> poses) {
  DS_TRACE("smooth");
  std::vector<Rigid3> smooth;
  smooth.reserve(poses.size());
  for (const std::span<const StampedPose> shot : ShotsOf(poses)) SmoothShot(shot, &smooth);
  return smooth;
}

}  // namespace dynamic_slam
