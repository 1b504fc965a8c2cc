#include "dynamic_slam/tracking/initial_structure.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamic_slam/optimize/bundle_adjustment.h"
#include "dynamic_slam/optimize/pose_optimizer.h"

namespace dynamic_slam {
namespace {

constexpr double kChi2TwoDof = 5.991;
constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// Too few sightings say nothing of a view's pose.
constexpr int kMinSightings = 20;

BundleProblem::Observation MakeObservation(uint32_t pose, uint32_t point, const Sighting& sighting) {
  return {pose, point, sighting.ideal_px, 1.0 / sighting.sigma_px, 1.0};
}

}  // namespace

InitialStructure RefineMotion(const Camera& camera, const TwoViewMotion& motion, const InitialViews& views) {
  InitialStructure structure;
  BundleProblem problem;
  problem.poses = {{Rigid3(), true}, {motion.second_from_first, false}};
  std::vector<uint32_t> point_of_keypoint(views.reference.size(), kNone);
  std::vector<uint32_t> match_of_point;
  for (uint32_t i = 0; i < views.last.size(); ++i) {
    if (motion.is_inlier[i] == 0) continue;
    const uint32_t point = static_cast<uint32_t>(problem.points.size());
    point_of_keypoint[views.last[i].reference_keypoint] = point;
    match_of_point.push_back(i);
    problem.points.push_back({motion.points_in_first[i], false});
    problem.observations.push_back(MakeObservation(0, point, views.reference[views.last[i].reference_keypoint]));
    problem.observations.push_back(MakeObservation(1, point, views.last[i]));
  }

  // The views between start from their neighbour's pose, backwards from the last one.
  PoseOptimizer optimizer(camera);
  PoseObservations observations;
  PoseEstimate estimate;
  Rigid3 neighbour = motion.second_from_first;
  for (size_t v = views.between.size(); v-- > 0;) {
    observations.Clear();
    for (const Sighting& sighting : views.between[v]) {
      const uint32_t point = point_of_keypoint[sighting.reference_keypoint];
      if (point == kNone) continue;
      observations.Add(problem.points[point].position, sighting.ideal_px, 1.0 / sighting.sigma_px);
    }
    optimizer.Optimize(observations, neighbour, &estimate);
    if (estimate.converged && estimate.inliers >= kMinSightings) neighbour = estimate.cam_from_world;
    // A view that fits badly stays: its cost tells against the motion.
    const uint32_t pose = static_cast<uint32_t>(problem.poses.size());
    problem.poses.push_back({neighbour, false});
    for (const Sighting& sighting : views.between[v]) {
      const uint32_t point = point_of_keypoint[sighting.reference_keypoint];
      if (point != kNone) problem.observations.push_back(MakeObservation(pose, point, sighting));
    }
  }

  BundleOptions options;
  options.max_iterations = 15;
  options.function_tolerance = 1e-5;
  std::vector<uint8_t> is_outlier;
  structure.usable = AdjustBundle(camera, options, {}, &problem, &is_outlier).usable;
  structure.last_from_reference = problem.poses[1].cam_from_world;
  structure.points_in_reference.assign(views.last.size(), Eigen::Vector3d::Zero());
  structure.is_good.assign(views.last.size(), 0);
  structure.costs.assign(views.last.size(), 0);
  for (size_t point = 0; point < problem.points.size(); ++point) {
    const uint32_t match = match_of_point[point];
    structure.points_in_reference[match] = problem.points[point].position;
    structure.is_good[match] = is_outlier[2 * point] == 0 && is_outlier[2 * point + 1] == 0;
    structure.points += structure.is_good[match];
  }
  for (const BundleProblem::Observation& observation : problem.observations) {
    const Eigen::Vector3d x_in_cam =
        problem.poses[observation.pose].cam_from_world * problem.points[observation.point].position;
    double cost = kChi2TwoDof;
    if (x_in_cam.z() > 0) {
      cost = (camera.Project(x_in_cam) - observation.ideal_px).squaredNorm() * observation.inverse_sigma_px *
             observation.inverse_sigma_px;
    }
    structure.costs[match_of_point[observation.point]] += std::min(cost, kChi2TwoDof);
  }
  // A match that the motion cannot place at all fits as badly as can be in the two outer views.
  for (size_t i = 0; i < views.last.size(); ++i) {
    if (motion.is_inlier[i] == 0) structure.costs[i] = 2 * kChi2TwoDof;
  }
  return structure;
}

double Preference(const InitialStructure& a, const InitialStructure& b) {
  double sum = 0, sum_of_squares = 0;
  const size_t n = a.costs.size();
  for (size_t i = 0; i < n; ++i) {
    const double difference = b.costs[i] - a.costs[i];
    sum += difference;
    sum_of_squares += difference * difference;
  }
  if (n < 2) return 0;
  const double mean = sum / static_cast<double>(n);
  const double variance = sum_of_squares / static_cast<double>(n) - mean * mean;
  return mean / std::sqrt(std::max(variance, 1e-12) / static_cast<double>(n));
}

}  // namespace dynamic_slam
