#include "dynamic_slam/tracking/initial_structure.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "dynamic_slam/geometry/chi2.h"
#include "dynamic_slam/geometry/triangulation.h"
#include "dynamic_slam/optimize/bundle_adjustment.h"
#include "dynamic_slam/optimize/pose_optimizer.h"

namespace dynamic_slam {
namespace {

constexpr double kFarBaselines = 200;
constexpr double kMinParallaxRad = 0.3 * std::numbers::pi / 180.0;  // less leaves the depth open
constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// Too few sightings say nothing of a view's pose.
constexpr int kMinSightings = 20;

BundleProblem::Observation MakeObservation(uint32_t pose, uint32_t point, const Sighting& sighting) {
  return {pose, point, sighting.ideal_px, 1.0 / sighting.sigma_px, 1.0};
}

// The match of each keypoint of the reference, or kNone.
std::vector<uint32_t> MatchesOfKeypoints(const InitialViews& views) {
  std::vector<uint32_t> matches(views.reference.size(), kNone);
  for (uint32_t i = 0; i < views.last.sightings.size(); ++i)
    matches[views.last.sightings[i].reference_keypoint] = i;
  return matches;
}

// Solves a bundle whose points are the matches, whose first observations are those of each match in the outer
// two views, and whose last view has the pose `last`.
void Solve(const Camera& camera, size_t last, BundleProblem* problem, InitialStructure* structure) {
  BundleOptions options;
  options.max_iterations = 15;
  options.function_tolerance = 1e-5;
  std::vector<uint8_t> is_outlier;
  structure->usable = AdjustBundle(camera, options, {}, problem, &is_outlier).usable;
  structure->last_from_reference = problem->poses[last].cam_from_world;
  const Eigen::Vector3d last_center = structure->last_from_reference.TargetOriginInSource();
  structure->points_in_reference.clear();
  structure->is_good.clear();
  structure->points = 0;
  for (size_t i = 0; i < problem->points.size(); ++i) {
    const Eigen::Vector3d& point = problem->points[i].position;
    structure->points_in_reference.push_back(point);
    const bool is_good = is_outlier[2 * i] == 0 && is_outlier[2 * i + 1] == 0 &&
                         ParallaxAngle(point, point - last_center) > kMinParallaxRad;
    structure->is_good.push_back(is_good);
    structure->points += is_good;
  }
}

// The motions of the views, in the order of time, from their neighbours' poses.
std::vector<SteadyMotion> MotionsOf(const std::vector<Rigid3>& poses, const std::vector<double>& stamps_s) {
  std::vector<SteadyMotion> between, motions;
  for (size_t i = 0; i + 1 < poses.size(); ++i)
    between.push_back(MotionBetween(poses[i + 1] * poses[i].Inverse(), stamps_s[i + 1] - stamps_s[i]));
  for (size_t i = 0; i < poses.size(); ++i)
    motions.push_back(Mean(between[i > 0 ? i - 1 : 0], between[std::min(i, between.size() - 1)]));
  return motions;
}

}  // namespace

double InitialStructure::MeanCost() const {
  return std::accumulate(costs.begin(), costs.end(), 0.0) /
         static_cast<double>(std::max<size_t>(costs.size(), 1));
}

InitialStructure RefineMotion(const Camera& camera, const TwoViewMotion& motion, const InitialViews& views) {
  InitialStructure structure;
  BundleProblem problem;
  problem.poses = {{Rigid3(), true}, {motion.second_from_first, false}};
  const std::vector<uint32_t> point_of_keypoint = MatchesOfKeypoints(views);
  for (uint32_t i = 0; i < views.last.sightings.size(); ++i) {
    const Sighting& in_reference = views.reference[views.last.sightings[i].reference_keypoint];
    // What two views cannot place starts far away: motions can be compared only when each has to explain
    // every match.
    const Eigen::Vector3d far = kFarBaselines * camera.Unproject(in_reference.ideal_px);
    problem.points.push_back({motion.is_inlier[i] != 0 ? motion.points_in_first[i] : far, false});
    problem.observations.push_back(MakeObservation(0, i, in_reference));
    problem.observations.push_back(MakeObservation(1, i, views.last.sightings[i]));
  }

  // The views between start from their neighbour's pose, backwards from the last one.
  PoseOptimizer optimizer(camera);
  PoseObservations observations;
  PoseEstimate estimate;
  Rigid3 neighbour = motion.second_from_first;
  std::vector<uint8_t> has_pose(views.between.size(), 0);
  for (size_t v = views.between.size(); v-- > 0;) {
    observations.Clear();
    for (const Sighting& sighting : views.between[v].sightings) {
      const uint32_t point = point_of_keypoint[sighting.reference_keypoint];
      if (point == kNone) continue;
      observations.Add(problem.points[point].position, sighting.ideal_px, 1.0 / sighting.sigma_px);
    }
    optimizer.Optimize(observations, neighbour, &estimate);
    has_pose[v] = estimate.converged && estimate.inliers >= kMinSightings;
    if (has_pose[v] != 0) neighbour = estimate.cam_from_world;
    // A view that fits badly stays: its cost tells against the motion.
    const uint32_t pose = static_cast<uint32_t>(problem.poses.size());
    problem.poses.push_back({neighbour, false});
    for (const Sighting& sighting : views.between[v].sightings) {
      const uint32_t point = point_of_keypoint[sighting.reference_keypoint];
      if (point != kNone) problem.observations.push_back(MakeObservation(pose, point, sighting));
    }
  }

  Solve(camera, 1, &problem, &structure);
  structure.between_from_reference.resize(views.between.size());
  for (size_t v = 0; v < views.between.size(); ++v) {
    // The problem has them backwards, after the outer two.
    if (has_pose[v] != 0)
      structure.between_from_reference[v] = problem.poses[1 + views.between.size() - v].cam_from_world;
  }
  structure.costs.assign(views.last.sightings.size(), 0);
  for (const BundleProblem::Observation& observation : problem.observations) {
    const Eigen::Vector3d x_in_cam =
        problem.poses[observation.pose].cam_from_world * problem.points[observation.point].position;
    double cost = kChi2TwoDof;
    if (x_in_cam.z() > 0) {
      cost = (camera.Project(x_in_cam) - observation.ideal_px).squaredNorm() * observation.inverse_sigma_px *
             observation.inverse_sigma_px;
    }
    structure.costs[observation.point] += std::min(cost, kChi2TwoDof);
  }
  return structure;
}

void CorrectShutters(const Camera& camera, const InitialViews& views, InitialStructure* structure) {
  // The views that have a pose, in the order of time.
  std::vector<size_t> between;
  std::vector<Rigid3> poses{Rigid3()};
  std::vector<double> stamps_s{views.reference_timestamp_s};
  for (size_t v = 0; v < views.between.size(); ++v) {
    if (!structure->between_from_reference[v].has_value()) continue;
    between.push_back(v);
    poses.push_back(*structure->between_from_reference[v]);
    stamps_s.push_back(views.between[v].timestamp_s);
  }
  poses.push_back(structure->last_from_reference);
  stamps_s.push_back(views.last.timestamp_s);
  const std::vector<SteadyMotion> motions = MotionsOf(poses, stamps_s);

  BundleProblem problem;
  for (const Rigid3& pose : poses) problem.poses.push_back({pose, problem.poses.empty()});
  for (const Eigen::Vector3d& point : structure->points_in_reference)
    problem.points.push_back({point, false});
  const auto observe = [&](size_t pose, uint32_t point, const Sighting& sighting) {
    const double depth = (poses[pose] * structure->points_in_reference[point]).z();
    problem.observations.push_back(MakeObservation(static_cast<uint32_t>(pose), point, sighting));
    problem.observations.back().ideal_px =
        AtMiddleRow(camera, motions[pose], sighting.ideal_px, sighting.raw_y, depth > 0 ? 1 / depth : 0);
  };
  const size_t last = poses.size() - 1;
  for (uint32_t i = 0; i < views.last.sightings.size(); ++i) {
    const Sighting& sighting = views.last.sightings[i];
    observe(0, i, views.reference[sighting.reference_keypoint]);
    observe(last, i, sighting);
  }
  const std::vector<uint32_t> point_of_keypoint = MatchesOfKeypoints(views);
  for (size_t i = 0; i < between.size(); ++i) {
    for (const Sighting& sighting : views.between[between[i]].sightings) {
      const uint32_t point = point_of_keypoint[sighting.reference_keypoint];
      if (point != kNone) observe(i + 1, point, sighting);
    }
  }
  Solve(camera, last, &problem, structure);
  for (size_t i = 0; i < between.size(); ++i)
    structure->between_from_reference[between[i]] = problem.poses[i + 1].cam_from_world;
  structure->reference_motion = motions.front();
  structure->last_motion = motions.back();
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
