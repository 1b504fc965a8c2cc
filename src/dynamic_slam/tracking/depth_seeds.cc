#include "dynamic_slam/tracking/depth_seeds.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/geometry/chi2.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {
namespace {

// Nothing at rest is expected nearer than this part of the median depth.
constexpr double kNearestDepthRatio = 0.3;

// Around its line, px of its octave: twice the gate of the filter, as descriptors tell most.
constexpr double kRadius_px = 5;

// A keypoint that is not found in so many frames in a row is gone: blur takes one or two.
constexpr int kMostMissed = 2;

// A depth is known when it is so uncertain, in parts of itself. On fr1_desk, against the depths that
// landmarks had later, what claims 0.1 errs by 0.05 to 0.07.
constexpr double kKnownDepth = 0.1;

// Nearest over second nearest distance in one octave.
constexpr double kRatio = 0.8;

constexpr double kInFront = 1e-6;

}  // namespace

bool DepthSeeds::Seed::IsKnown() const { return std::sqrt(variance) < kKnownDepth * inverse_depth; }

void DepthSeeds::Scale(double factor) {
  for (Seed& seed : seeds_) {
    seed.origin *= factor;
    seed.inverse_depth /= factor;
    seed.variance /= factor * factor;
  }
}

void DepthSeeds::Follow(const Rigid3& frame_from_last, double median_depth, const Frame& frame) {
  DS_TRACE("tracking/seeds");
  if (!(median_depth > 0)) {
    Clear();
    return;
  }
  const double nearest_depth = kNearestDepthRatio * median_depth;
  const Eigen::Matrix3d rotation = frame_from_last.Matrix();
  seed_of_.assign(frame.features.size(), kNone);
  hits_.clear();
  for (uint32_t k = 0; k < seeds_.size(); ++k) {
    Seed& seed = seeds_[k];
    seed.origin = rotation * seed.origin + frame_from_last.translation;
    seed.direction = rotation * seed.direction;
    hits_.push_back(Find(seed, nearest_depth, frame));
    const Hit& hit = hits_.back();
    if (hit.keypoint == kNone) continue;
    uint32_t& holder = seed_of_[hit.keypoint];
    if (holder == kNone || hit.distance < hits_[holder].distance) holder = k;
  }
  size_t kept = 0;
  for (uint32_t k = 0; k < seeds_.size(); ++k) {
    Seed& seed = seeds_[k];
    seed.keypoint = hits_[k].keypoint;
    if (seed.keypoint != kNone && seed_of_[seed.keypoint] != k) seed.keypoint = kNone;
    if (seed.keypoint == kNone) {
      if (++seed.missed > kMostMissed) continue;
    } else {
      const Keypoint& keypoint = frame.features.keypoints[seed.keypoint];
      const bool fits = !frame.landmarks[seed.keypoint].IsValid() && Measure(keypoint, &seed) &&
                        seed.inverse_depth * nearest_depth < 1;
      if (!fits) {
        seed_of_[seed.keypoint] = kNone;
        continue;
      }
      seed.missed = 0;
      seed.descriptor = frame.features.descriptors[seed.keypoint];
      seed.octave = keypoint.octave;
    }
    seeds_[kept++] = seed;
  }
  seeds_.resize(kept);
  Sow(median_depth, frame);
}

DS_DISPATCH_POPCNT
DepthSeeds::Hit DepthSeeds::Find(const Seed& seed, double nearest_depth, const Frame& frame) const {
  const double sigma = std::sqrt(seed.variance);
  const double least = std::max(0.0, seed.inverse_depth - 2 * sigma);
  const double most = std::min(1 / nearest_depth, seed.inverse_depth + 2 * sigma);
  const Eigen::Vector3d far = seed.direction + least * seed.origin;
  const Eigen::Vector3d near = seed.direction + most * seed.origin;
  if (far.z() <= kInFront || near.z() <= kInFront) return {};
  const float radius_px = static_cast<float>(kRadius_px) * octave_scales_[static_cast<size_t>(seed.octave)];
  Hit best, second;
  frame.grid.ForEachAlong(
      camera_.Project(far).cast<float>(), camera_.Project(near).cast<float>(), radius_px, seed.octave - 1,
      seed.octave + 1, [&](uint32_t j) __attribute__((always_inline)) {
        const int distance = HammingDistance(seed.descriptor, frame.features.descriptors[j]);
        if (distance >= second.distance) return;
        second = {j, distance};
        if (distance < best.distance) std::swap(best, second);
      });
  if (best.distance > kStrictDistance) return {};
  const auto octave = [&](const Hit& hit) { return frame.features.keypoints[hit.keypoint].octave; };
  const bool is_rivalled =
      second.keypoint != kNone && octave(second) == octave(best) && best.distance > kRatio * second.distance;
  const bool is_usable = !is_rivalled && frame.StaticProbability(best.keypoint) >= kMinStaticProbability;
  return is_usable ? best : Hit();
}

// A Kalman filter's step: both keypoints are as exact as their octaves allow.
bool DepthSeeds::Measure(const Keypoint& keypoint, Seed* seed) const {
  const Eigen::Vector3d x = seed->direction + seed->inverse_depth * seed->origin;
  if (x.z() <= kInFront) return false;
  const Eigen::Vector2d error_px = Eigen::Vector2d(keypoint.x, keypoint.y) - camera_.Project(x);
  const double over_z = 1 / x.z();
  const Eigen::Vector2d slope(camera_.fx * over_z * (seed->origin.x() - x.x() * over_z * seed->origin.z()),
                              camera_.fy * over_z * (seed->origin.y() - x.y() * over_z * seed->origin.z()));
  const double scale = octave_scales_[static_cast<size_t>(keypoint.octave)];
  const double noise_px2 = scale * scale + seed->first_scale * seed->first_scale;
  // (noise I + variance slope slope^T)^-1, of which the error along the slope is all that tells of the depth.
  const double along = slope.dot(error_px), spread_px2 = noise_px2 + seed->variance * slope.squaredNorm();
  const double chi2 = (error_px.squaredNorm() - seed->variance * along * along / spread_px2) / noise_px2;
  if (!(chi2 <= kChi2TwoDof)) return false;
  seed->inverse_depth = std::max(0.0, seed->inverse_depth + seed->variance * along / spread_px2);
  seed->variance *= noise_px2 / spread_px2;
  return true;
}

void DepthSeeds::Sow(double median_depth, const Frame& frame) {
  for (uint32_t i = 0; i < frame.features.size(); ++i) {
    if (seed_of_[i] != kNone || frame.landmarks[i].IsValid() || frame.MovesForSure(i)) continue;
    if (frame.StaticProbability(i) < kMinStaticProbability) continue;
    const Keypoint& keypoint = frame.features.keypoints[i];
    Seed seed;
    seed.origin.setZero();
    seed.direction = camera_.Unproject({keypoint.x, keypoint.y});
    // From infinity to half of the median depth within one deviation.
    seed.inverse_depth = 1 / median_depth;
    seed.variance = seed.inverse_depth * seed.inverse_depth;
    seed.first_scale = octave_scales_[static_cast<size_t>(keypoint.octave)];
    seed.descriptor = frame.features.descriptors[i];
    seed.octave = keypoint.octave;
    seed.keypoint = i;
    seeds_.push_back(seed);
  }
}

int DepthSeeds::Plant(KeyframeId id, Map* map) {
  const Keyframe& keyframe = map->keyframes().At(id);
  const Rigid3 world_from_cam = keyframe.cam_from_world().Inverse();
  const auto is_free = [&](const Sighting& sighting) {
    const Keyframe* other = map->keyframes().Find(sighting.keyframe);
    return other != nullptr && other->part() == keyframe.part() &&
           !other->landmarks()[sighting.keypoint].IsValid() &&
           other->StaticProbability(sighting.keypoint) >= kMinStaticProbability;
  };
  const auto plant = [&](Seed* seed) {
    const auto end = seed->seen_by.begin() + static_cast<std::ptrdiff_t>(seed->sightings);
    const auto gone = std::stable_partition(seed->seen_by.begin(), end, is_free);
    seed->sightings = static_cast<size_t>(gone - seed->seen_by.begin());
    if (seed->sightings == 0) return false;
    const Eigen::Vector3d x_in_cam = seed->origin + seed->direction / seed->inverse_depth;
    const LandmarkId landmark = map->AddLandmark(world_from_cam * x_in_cam, id).id();
    for (size_t k = 0; k < seed->sightings; ++k)
      map->Link(seed->seen_by[k].keyframe, seed->seen_by[k].keypoint, landmark);
    map->Link(id, seed->keypoint, landmark);
    map->RefreshLandmark(landmark);
    return true;
  };
  int planted = 0;
  size_t kept = 0;
  for (Seed& seed : seeds_) {
    if (seed.keypoint != kNone && !keyframe.landmarks()[seed.keypoint].IsValid()) {
      if (seed.IsKnown() && plant(&seed)) {
        ++planted;
        continue;
      }
      if (seed.sightings < seed.seen_by.size()) seed.seen_by[seed.sightings++] = {id, seed.keypoint};
    }
    seeds_[kept++] = seed;
  }
  seeds_.resize(kept);
  return planted;
}

}  // namespace dynamic_slam
