#include "dynamic_slam/mapping/landmark_factory.h"

#include <cmath>
#include <numbers>

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/geometry/chi2.h"
#include "dynamic_slam/geometry/triangulation.h"

namespace dynamic_slam {
namespace {

// Nearest over second nearest distance along the line.
constexpr double kEpipolarRatio = 0.9;

// Nothing is expected nearer than this part of the median depth.
constexpr double kNearestDepthRatio = 0.1;

// By so much more than one octave may the size of a point's image differ from what the distances tell.
constexpr double kScaleSlack = 1.5;

struct FreeKeypoints {
  std::vector<uint32_t> indices;
  std::vector<float> x, y;
  std::vector<float> max_distance_px;  // to the epipolar line
  std::vector<Descriptor> descriptors;
  std::vector<int> octaves;
};

FreeKeypoints CollectFree(const Keyframe& keyframe, const std::vector<float>& scales) {
  FreeKeypoints free;
  for (uint32_t i = 0; i < keyframe.landmarks().size(); ++i) {
    if (keyframe.landmarks()[i].IsValid() || keyframe.StaticProbability(i) < kMinStaticProbability) continue;
    const Keypoint& keypoint = keyframe.keypoint(i);
    free.indices.push_back(i);
    free.x.push_back(keypoint.x);
    free.y.push_back(keypoint.y);
    free.max_distance_px.push_back(std::sqrt(static_cast<float>(kChi2OneDof)) *
                                   scales[static_cast<size_t>(keypoint.octave)]);
    free.descriptors.push_back(keyframe.features().descriptors[i]);
    free.octaves.push_back(keypoint.octave);
  }
  return free;
}

// The part of an epipolar line a x + b y + c = 0 (a^2 + b^2 = 1) on which a point can lie: `from` is where
// the nearest depth projects to, `along` the direction to where infinity does, `length` the distance between.
struct EpipolarSegment {
  float a, b, c;
  float from_x, from_y, along_x, along_y, length;
};

DS_DISPATCH_POPCNT
uint32_t FindOnSegment(const FreeKeypoints& candidates, const EpipolarSegment& segment,
                       const Descriptor& descriptor, int octave) {
  int best_distance = kStrictDistance + 1, second_distance = 257;
  float best_along = 0;
  uint32_t best = WindowMatch::kNone;
  const uint32_t count = static_cast<uint32_t>(candidates.indices.size());
  for (uint32_t j = 0; j < count; ++j) {
    const float off = segment.a * candidates.x[j] + segment.b * candidates.y[j] + segment.c;
    if (std::abs(off) > candidates.max_distance_px[j]) continue;
    const float along = (candidates.x[j] - segment.from_x) * segment.along_x +
                        (candidates.y[j] - segment.from_y) * segment.along_y;
    const float slack = 2.0f * candidates.max_distance_px[j];
    if (along < -slack || along > segment.length + slack) continue;
    if (std::abs(candidates.octaves[j] - octave) > 3) continue;
    const int distance = HammingDistance(descriptor, candidates.descriptors[j]);
    // The same corner in the next octave is no rival.
    const bool is_rival = best == WindowMatch::kNone || std::abs(along - best_along) > slack;
    if (distance < best_distance) {
      if (best != WindowMatch::kNone && is_rival) second_distance = best_distance;
      best_distance = distance;
      best_along = along;
      best = j;
    } else if (distance < second_distance && is_rival) {
      second_distance = distance;
    }
  }
  return best_distance > kEpipolarRatio * second_distance ? WindowMatch::kNone : best;
}

}  // namespace

LandmarkFactory::LandmarkFactory(const Camera& camera, const MapperOptions& options)
    : camera_(camera), options_(options) {}

std::vector<KeyframeId> LandmarkFactory::Neighbours(const Map& map, KeyframeId id) const {
  std::vector<KeyframeId> neighbours;
  const Keyframe& keyframe = map.keyframes().At(id);
  const size_t count = static_cast<size_t>(options_.triangulation_neighbours);
  for (const CovisibleKeyframe& other : keyframe.BestCovisible(keyframe.covisible().size())) {
    if (neighbours.size() == count) break;
    const Keyframe& neighbour = map.keyframes().At(other.id);
    const double baseline = (neighbour.CenterInWorld() - keyframe.CenterInWorld()).norm();
    if (baseline >= options_.min_baseline_ratio * map.MedianDepth(other.id)) neighbours.push_back(other.id);
  }
  return neighbours;
}

std::vector<LandmarkId> LandmarkFactory::Add(const std::vector<LandmarkProposal>& proposals, Map* map) {
  std::vector<LandmarkId> added;
  for (const LandmarkProposal& proposal : proposals) {
    const Keyframe* first = map->keyframes().Find(proposal.first);
    const Keyframe* second = map->keyframes().Find(proposal.second);
    if (first == nullptr || second == nullptr || first->landmarks()[proposal.first_keypoint].IsValid() ||
        second->landmarks()[proposal.second_keypoint].IsValid()) {
      continue;
    }
    const LandmarkId id = map->AddLandmark(proposal.position, proposal.first).id();
    map->Link(proposal.first, proposal.first_keypoint, id);
    map->Link(proposal.second, proposal.second_keypoint, id);
    map->RefreshLandmark(id);
    added.push_back(id);
  }
  return added;
}

std::vector<LandmarkProposal> LandmarkFactory::Propose(const Map& map, KeyframeId keyframe_id,
                                                       KeyframeId neighbour_id) const {
  std::vector<LandmarkProposal> proposals;
  const Keyframe& keyframe = map.keyframes().At(keyframe_id);
  const Keyframe& neighbour = map.keyframes().At(neighbour_id);
  const double median_depth = map.MedianDepth(neighbour_id);
  const std::vector<float>& scales = map.octave_scales();
  const Rigid3 neighbour_from_keyframe = neighbour.cam_from_world() * keyframe.cam_from_world().Inverse();
  const Eigen::Matrix3d rotation = neighbour_from_keyframe.Matrix();
  const Rigid3 world_from_keyframe = keyframe.cam_from_world().Inverse();
  const TwoViewTriangulator triangulator(neighbour_from_keyframe);
  const double min_parallax = options_.min_parallax_deg * std::numbers::pi / 180.0;
  const double max_scale_ratio = kScaleSlack * (scales.size() > 1 ? scales[1] : 1.0);

  struct Found {
    uint32_t first, second;
  };
  std::vector<Found> found;
  RotationConsistency consistency;
  const FreeKeypoints mine = CollectFree(keyframe, scales);
  const FreeKeypoints theirs = CollectFree(neighbour, scales);
  for (size_t i = 0; i < mine.indices.size(); ++i) {
    const Eigen::Vector3d ray = camera_.Unproject({mine.x[i], mine.y[i]});
    const Eigen::Vector3d far = rotation * ray;
    if (far.z() <= 0) continue;
    // Nearest to both: a neighbour ahead has passed the start of the ray.
    const double nearest = kNearestDepthRatio * median_depth;
    const double depth = std::max(nearest, (nearest - neighbour_from_keyframe.translation.z()) / far.z());
    const Eigen::Vector3d near = depth * far + neighbour_from_keyframe.translation;
    const Eigen::Vector2d near_px = camera_.Project(near), far_px = camera_.Project(far);
    const Eigen::Vector2d span = far_px - near_px;
    const double length = span.norm();
    if (length < 1e-6) continue;
    const Eigen::Vector2d along = span / length;
    const EpipolarSegment segment{static_cast<float>(-along.y()),
                                  static_cast<float>(along.x()),
                                  static_cast<float>(along.y() * far_px.x() - along.x() * far_px.y()),
                                  static_cast<float>(near_px.x()),
                                  static_cast<float>(near_px.y()),
                                  static_cast<float>(along.x()),
                                  static_cast<float>(along.y()),
                                  static_cast<float>(length)};
    const uint32_t j = FindOnSegment(theirs, segment, mine.descriptors[i], mine.octaves[i]);
    if (j == WindowMatch::kNone) continue;
    found.push_back({mine.indices[i], theirs.indices[j]});
    consistency.Add(keyframe.keypoint(mine.indices[i]).angle_rad,
                    neighbour.keypoint(theirs.indices[j]).angle_rad);
  }

  const std::vector<uint8_t>& keep = consistency.Judge();
  for (size_t k = 0; k < found.size(); ++k) {
    if (keep[k] == 0) continue;
    const Keypoint& first = keyframe.keypoint(found[k].first);
    const Keypoint& second = neighbour.keypoint(found[k].second);
    const Eigen::Vector3d first_ray = camera_.Unproject({first.x, first.y});
    const Eigen::Vector3d second_ray = camera_.Unproject({second.x, second.y});
    if (ParallaxAngle(rotation * first_ray, second_ray) < min_parallax) continue;
    const std::optional<Eigen::Vector3d> x_in_keyframe = triangulator.Triangulate(first_ray, second_ray);
    if (!x_in_keyframe.has_value()) continue;

    const double first_scale = scales[static_cast<size_t>(first.octave)];
    const double second_scale = scales[static_cast<size_t>(second.octave)];
    const Eigen::Vector3d x_in_neighbour = neighbour_from_keyframe * *x_in_keyframe;
    const double first_error =
        (camera_.Project(*x_in_keyframe) - Eigen::Vector2d(first.x, first.y)).squaredNorm();
    const double second_error =
        (camera_.Project(x_in_neighbour) - Eigen::Vector2d(second.x, second.y)).squaredNorm();
    if (first_error > kChi2TwoDof * first_scale * first_scale) continue;
    if (second_error > kChi2TwoDof * second_scale * second_scale) continue;
    // The octaves must tell the same ratio of distances as the geometry.
    const double distance_ratio = x_in_neighbour.norm() / x_in_keyframe->norm();
    const double octave_ratio = first_scale / second_scale;
    if (distance_ratio > octave_ratio * max_scale_ratio || distance_ratio * max_scale_ratio < octave_ratio)
      continue;

    proposals.push_back(
        {keyframe_id, neighbour_id, found[k].first, found[k].second, world_from_keyframe * *x_in_keyframe});
  }
  return proposals;
}

}  // namespace dynamic_slam
