#include "dynamic_slam/tracking/initializer.h"

#include <algorithm>
#include <utility>

#include "dynamic_slam/optimize/bundle_adjustment.h"

namespace dynamic_slam {
namespace {

constexpr double kMatchRatio = 0.9;

}  // namespace

Initializer::Initializer(const Camera& camera, const InitializerOptions& options) : camera_(camera), options_(options) {
  Reset();
}

void Initializer::Reset() {
  reference_.reset();
  reason_ = "waiting for the first image";
}

void Initializer::StartFrom(const Frame& frame) {
  reference_ = frame;
  last_places_.resize(frame.features.size());
  for (size_t i = 0; i < last_places_.size(); ++i) {
    last_places_[i] = {frame.features.keypoints[i].x, frame.features.keypoints[i].y};
  }
}

std::vector<Match> Initializer::MatchWithReference(const Frame& frame) {
  const FeatureSet& first = reference_->features;
  struct Taker {
    uint32_t reference = WindowMatch::kNone;
    int distance = 257;
  };
  std::vector<Taker> takers(frame.features.size());
  for (uint32_t i = 0; i < first.size(); ++i) {
    const int octave = first.keypoints[i].octave;
    if (octave > options_.max_octave) continue;
    const SearchWindow window{last_places_[i].x(), last_places_[i].y(), static_cast<float>(options_.search_radius_px),
                              std::max(0, octave - 1), std::min(octave + 1, options_.max_octave)};
    const WindowMatch match = FindInWindow(frame.features, frame.grid, window, first.descriptors[i], {});
    if (match.distance > kStrictDistance || match.distance > kMatchRatio * match.second_distance) continue;
    if (match.distance < takers[match.keypoint].distance) takers[match.keypoint] = {i, match.distance};
  }
  std::vector<Match> matches;
  RotationConsistency rotation;
  for (uint32_t i = 0; i < takers.size(); ++i) {
    if (takers[i].reference == WindowMatch::kNone) continue;
    matches.push_back({takers[i].reference, i, takers[i].distance});
    rotation.Add(first.keypoints[takers[i].reference].angle_rad, frame.features.keypoints[i].angle_rad);
  }
  const std::vector<uint8_t>& keep = rotation.Judge();
  size_t kept = 0;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (keep[i] == 0) continue;
    matches[kept++] = matches[i];
    const Keypoint& keypoint = frame.features.keypoints[matches[i].second];
    last_places_[matches[i].first] = {keypoint.x, keypoint.y};
  }
  matches.resize(kept);
  return matches;
}

bool Initializer::TryFrame(Frame* frame, Random& random, Map* map) {
  if (!reference_.has_value()) {
    if (static_cast<int>(frame->features.size()) < options_.min_matches) {
      reason_ = fmt::format("initialising: {} keypoints < {}; point the camera at something with texture",
                            frame->features.size(), options_.min_matches);
    } else {
      StartFrom(*frame);
      reason_ = "initialising: waiting for a second view";
    }
    return false;
  }
  const std::vector<Match> matches = MatchWithReference(*frame);
  if (static_cast<int>(matches.size()) < options_.min_matches) {
    reason_ = fmt::format("initialising: {} matches < {} with the first view; starting again from this one",
                          matches.size(), options_.min_matches);
    StartFrom(*frame);
    return false;
  }
  std::vector<Eigen::Vector2d> first_px, second_px;
  for (const Match& match : matches) {
    const Keypoint& first = reference_->features.keypoints[match.first];
    const Keypoint& second = frame->features.keypoints[match.second];
    first_px.emplace_back(first.x, first.y);
    second_px.emplace_back(second.x, second.y);
  }
  const TwoViewResult motion = EstimateTwoView(camera_, first_px, second_px, options_.two_view, random);
  if (!motion.Succeeded()) {
    reason_ = "initialising: " + Explain(motion);
    return false;
  }
  return BuildMap(motion, matches, frame, map);
}

bool Initializer::BuildMap(const TwoViewResult& motion, const std::vector<Match>& matches, Frame* frame, Map* map) {
  BundleProblem problem;
  problem.poses = {{Rigid3(), true}, {motion.second_from_first, false}};
  std::vector<Match> used;
  const std::vector<float>& scales = map->octave_scales();
  for (size_t i = 0; i < matches.size(); ++i) {
    if (motion.is_inlier[i] == 0) continue;
    const uint32_t point = static_cast<uint32_t>(used.size());
    const Keypoint& first = reference_->features.keypoints[matches[i].first];
    const Keypoint& second = frame->features.keypoints[matches[i].second];
    problem.points.push_back({motion.points_in_first[i], false});
    problem.observations.push_back({0, point, {first.x, first.y}, 1.0 / scales[static_cast<size_t>(first.octave)], 1.0});
    problem.observations.push_back({1, point, {second.x, second.y}, 1.0 / scales[static_cast<size_t>(second.octave)], 1.0});
    used.push_back(matches[i]);
  }
  BundleOptions bundle;
  bundle.max_iterations = 20;
  std::vector<uint8_t> is_outlier;
  const BundleSummary summary = AdjustBundle(camera_, bundle, {}, &problem, &is_outlier);
  std::vector<double> depths;
  for (size_t i = 0; i < used.size(); ++i) {
    if (is_outlier[2 * i] == 0 && is_outlier[2 * i + 1] == 0) depths.push_back(problem.points[i].position.z());
  }
  if (!summary.usable || static_cast<int>(depths.size()) < options_.two_view.min_points) {
    reason_ = fmt::format("initialising: {} points survive the first bundle adjustment < {}", depths.size(),
                          options_.two_view.min_points);
    return false;
  }
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  const double scale = 1.0 / *middle;

  reference_->cam_from_world = Rigid3();
  reference_->ClearLandmarks();
  frame->cam_from_world = problem.poses[1].cam_from_world;
  frame->cam_from_world.translation *= scale;
  frame->ClearLandmarks();
  const KeyframeId first_id = InsertKeyframe(*reference_, map);
  const KeyframeId second_id = InsertKeyframe(*frame, map);
  for (size_t i = 0; i < used.size(); ++i) {
    if (is_outlier[2 * i] != 0 || is_outlier[2 * i + 1] != 0) continue;
    const Eigen::Vector3d position = scale * problem.points[i].position;
    const LandmarkId id = map->AddLandmark(position, second_id).id();
    map->Link(first_id, used[i].first, id);
    map->Link(second_id, used[i].second, id);
    map->RefreshLandmark(id);
    frame->landmarks[used[i].second] = id;
    frame->points[used[i].second] = position;
  }
  frame->reference = second_id;
  frame->cam_from_reference = Rigid3();
  reason_ = fmt::format("initialised: {} points, parallax {:.1f} deg, {}", depths.size(), motion.parallax_deg,
                        motion.from_homography ? "planar scene" : "general scene");
  return true;
}

}  // namespace dynamic_slam
