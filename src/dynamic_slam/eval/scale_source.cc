#include "dynamic_slam/eval/scale_source.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/eval/metrics.h"

namespace dynamic_slam {
namespace {

constexpr char kRemedy[] =
    "Give distance:A,B,METRES (A and B: stamps, s), camera-height:METRES or file:TRAJECTORY.";

double ReadMetres(const std::string& text, std::string_view number) {
  const std::optional<double> metres = ParseDouble(Trim(number));
  if (!metres.has_value() || !(*metres > 0) || !std::isfinite(*metres)) {
    throw InputError(fmt::format("--scale-from {}", text), fmt::format("'{}' is no length in m", number),
                     kRemedy);
  }
  return *metres;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Where a path of constant acceleration through the poses about the time is then, and how far they scatter
// around it.
struct SmoothPosition {
  Eigen::Vector3d position;
  double sigma;
};

SmoothPosition PositionAt(const Trajectory& trajectory, double time_s) {
  constexpr size_t kPoses = 9;
  const auto next = std::lower_bound(trajectory.begin(), trajectory.end(), time_s,
                                     [](const StampedPose& pose, double t) { return pose.timestamp_s < t; });
  const size_t at = static_cast<size_t>(next - trajectory.begin());
  const size_t first = std::min(at > kPoses / 2 ? at - kPoses / 2 : 0, trajectory.size() - kPoses);
  Eigen::Matrix<double, kPoses, 3> design, positions;
  for (size_t i = 0; i < kPoses; ++i) {
    const StampedPose& pose = trajectory[first + i];
    const double t = pose.timestamp_s - time_s;
    const auto row = static_cast<Eigen::Index>(i);
    design.row(row) << 1, t, t * t;
    positions.row(row) = pose.world_from_cam.translation.transpose();
  }
  const Eigen::Matrix3d path = design.colPivHouseholderQr().solve(positions);
  const double degrees_of_freedom = kPoses - 3;
  const double sigma = std::sqrt((positions - design * path).squaredNorm() / (3 * degrees_of_freedom));
  return {path.row(0).transpose(), sigma};
}

void RequirePoseNear(const Trajectory& trajectory, double time_s) {
  constexpr double kNearS = 0.5;
  constexpr size_t kFewest = 9;  // of PositionAt
  const bool is_near = trajectory.size() >= kFewest &&
                       std::any_of(trajectory.begin(), trajectory.end(), [&](const StampedPose& pose) {
                         return std::abs(pose.timestamp_s - time_s) < kNearS;
                       });
  if (is_near) return;
  throw InputError(
      fmt::format("--scale-from distance, time {:.3f} s", time_s), "the camera has no pose near it",
      trajectory.empty() ? "There is no trajectory."
                         : fmt::format("The trajectory is from {:.3f} to {:.3f} s.",
                                       trajectory.front().timestamp_s, trajectory.back().timestamp_s));
}

// A plane below a camera: normal . x = height, x in cam.
struct GroundPlane {
  Eigen::Vector3d normal;
  double height = 0;
  int points = 0;
};

// Landmarks that the keyframe and its neighbours see, in cam, that could be of the ground: below the horizon.
std::vector<Eigen::Vector3d> PointsBelow(const Map& map, const Keyframe& keyframe) {
  constexpr size_t kNeighbours = 10;
  constexpr double kMinTangent = 0.05;  // of the angle below the optical axis
  std::vector<LandmarkId> ids = keyframe.landmarks();
  for (const CovisibleKeyframe& neighbour : keyframe.BestCovisible(kNeighbours)) {
    const std::vector<LandmarkId>& seen = map.keyframes().At(neighbour.id).landmarks();
    ids.insert(ids.end(), seen.begin(), seen.end());
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  std::vector<Eigen::Vector3d> points;
  for (const LandmarkId id : ids) {
    if (!id.IsValid()) continue;
    const Eigen::Vector3d x = keyframe.cam_from_world() * map.landmarks().At(id).position();
    if (x.z() > 0 && x.y() > kMinTangent * x.z()) points.push_back(x);
  }
  return points;
}

constexpr double kMaxSlope = 0.27;   // tan 15 deg: how far the ground leans against the camera
constexpr double kThickness = 0.04;  // of the height: how far a point of the ground may be off
constexpr int kMinPoints = 25;

bool IsGroundNormal(const Eigen::Vector3d& normal) {
  return normal.y() > 0 && std::hypot(normal.x(), normal.z()) < kMaxSlope * normal.y();
}

std::optional<GroundPlane> FindGround(const std::vector<Eigen::Vector3d>& points, Random* random) {
  if (points.size() < kMinPoints) return std::nullopt;
  const auto score = [&](const GroundPlane& plane) {
    const double thickness = kThickness * plane.height;
    int on = 0, below = 0;
    for (const Eigen::Vector3d& x : points) {
      const double depth = plane.normal.dot(x) - plane.height;
      on += std::abs(depth) < thickness;
      below += depth > 3 * thickness;
    }
    return below > on / 3 ? 0 : on;  // nothing is below the ground
  };
  GroundPlane best;
  constexpr int kSamples = 300;
  const auto count = static_cast<uint32_t>(points.size());
  for (int i = 0; i < kSamples; ++i) {
    const Eigen::Vector3d &a = points[random->Index(count)], &b = points[random->Index(count)],
                          &c = points[random->Index(count)];
    Eigen::Vector3d normal = (b - a).cross(c - a);
    if (!(normal.norm() > 1e-9 * a.squaredNorm())) continue;
    normal.normalize();
    if (normal.y() < 0) normal = -normal;
    GroundPlane plane{normal, normal.dot(a), 0};
    if (!IsGroundNormal(normal) || !(plane.height > 0)) continue;
    plane.points = score(plane);
    if (plane.points > best.points) best = plane;
  }
  if (best.points < kMinPoints) return std::nullopt;
  // The plane through all of its points.
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> on;
  for (const Eigen::Vector3d& x : points) {
    if (std::abs(best.normal.dot(x) - best.height) < kThickness * best.height) on.push_back(x);
  }
  for (const Eigen::Vector3d& x : on) mean += x / static_cast<double>(on.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& x : on) scatter += (x - mean) * (x - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(scatter);
  Eigen::Vector3d normal = axes.eigenvectors().col(0);
  if (normal.y() < 0) normal = -normal;
  const double spread = std::sqrt(axes.eigenvalues()[1] / static_cast<double>(on.size()));
  if (!IsGroundNormal(normal) || spread < 0.25 * best.height)
    return std::nullopt;  // a line of points is no ground
  return GroundPlane{normal, normal.dot(mean), static_cast<int>(on.size())};
}

}  // namespace

ScaleSource ParseScaleSource(const std::string& text) {
  const size_t colon = text.find(':');
  const std::string kind = text.substr(0, colon),
                    rest = colon == std::string::npos ? "" : text.substr(colon + 1);
  if (kind == "file" && !rest.empty()) return KnownTrajectory{rest};
  if (kind == "camera-height") return KnownHeight{ReadMetres(text, rest)};
  const std::vector<std::string_view> columns = SplitColumns(rest, ",");
  if (kind == "distance" && columns.size() == 3) {
    const std::optional<double> first_s = ParseDouble(columns[0]), second_s = ParseDouble(columns[1]);
    if (first_s.has_value() && second_s.has_value())
      return KnownDistance{*first_s, *second_s, ReadMetres(text, columns[2])};
  }
  throw InputError(fmt::format("--scale-from {}", text), "says no length", kRemedy);
}

MetricScale ScaleFromDistance(const Trajectory& trajectory, const KnownDistance& distance) {
  RequirePoseNear(trajectory, distance.first_s);
  RequirePoseNear(trajectory, distance.second_s);
  const SmoothPosition first = PositionAt(trajectory, distance.first_s),
                       second = PositionAt(trajectory, distance.second_s);
  const double units = (second.position - first.position).norm();
  const double sigma = std::hypot(first.sigma, second.sigma);
  if (!(units > 10 * sigma) || !(units > 0)) {
    throw InputError("--scale-from distance", "the camera hardly moved between the two times",
                     "Choose times between which it went far, in one direction.");
  }
  return {distance.metres / units, sigma / units,
          fmt::format("{} m from {:.3f} to {:.3f} s", distance.metres, distance.first_s, distance.second_s)};
}

MetricScale ScaleFromHeight(const Map& map, PartId part, const KnownHeight& height, uint64_t seed) {
  Random random(seed);
  std::vector<double> heights;
  size_t keyframes = 0;
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != part) return;
    ++keyframes;
    const std::optional<GroundPlane> ground = FindGround(PointsBelow(map, keyframe), &random);
    if (ground.has_value()) heights.push_back(ground->height);
  });
  constexpr size_t kFewest = 5;
  constexpr double kFewestShare = 0.15, kMaxSpread = 0.25;
  const auto fail = [&](const std::string& reason) {
    throw InputError(
        "--scale-from camera-height", reason,
        "The camera must look ahead, upright, and see flat ground with texture; else give a distance.");
  };
  if (heights.size() < kFewest ||
      static_cast<double>(heights.size()) < kFewestShare * static_cast<double>(keyframes)) {
    fail(fmt::format("the ground is not visible: a plane below the camera was found at {} of {} keyframes",
                     heights.size(), keyframes));
  }
  const double median = Median(heights);
  std::vector<double> deviations;
  for (const double h : heights) deviations.push_back(std::abs(h - median));
  const double spread = 1.4826 * Median(deviations) / median;  // that of a Gaussian
  if (spread > kMaxSpread) {
    fail(fmt::format("the ground is not visible: the heights above what looks like it differ by {:.0f} %",
                     100 * spread));
  }
  // Neighbours see the same points: as if one in ten were independent.
  const double independent = std::max(1.0, static_cast<double>(heights.size()) / 10);
  return {height.metres / median, spread / std::sqrt(independent),
          fmt::format("camera {} m above the ground, seen from {} of {} keyframes", height.metres,
                      heights.size(), keyframes)};
}

MetricScale ScaleFromTrajectory(const Trajectory& trajectory, const Trajectory& metric,
                                const std::string& name) {
  constexpr size_t kPieces = 10;
  constexpr double kMaxDtS = 0.02;
  const MatchedPoses matched = MatchByTime(ToPoseList(metric), ToPoseList(trajectory), kMaxDtS);
  const size_t n = matched.estimate.size();
  if (n < 3 * kPieces) {
    throw InputError(
        name, fmt::format("has {} poses at times of the trajectory, and {} are needed", n, 3 * kPieces),
        "Do the stamps of both count from the same time?");
  }
  const auto scale_without = [&](size_t begin, size_t end) {
    MatchedPoses rest;
    for (size_t i = 0; i < n; ++i) {
      if (i >= begin && i < end) continue;
      rest.reference.push_back(matched.reference[i]);
      rest.estimate.push_back(matched.estimate[i]);
    }
    return AbsolutePoseError(rest, Alignment::kSim3).reference_from_estimate.scale;
  };
  const double scale = scale_without(0, 0);
  double sum = 0;
  for (size_t piece = 0; piece < kPieces; ++piece) {
    const double difference = scale_without(piece * n / kPieces, (piece + 1) * n / kPieces) - scale;
    sum += difference * difference;
  }
  const double sigma = std::sqrt(sum * (kPieces - 1) / kPieces);
  return {scale, sigma / scale, fmt::format("{} poses of {}", n, name)};
}

}  // namespace dynamic_slam
