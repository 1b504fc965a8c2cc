#include "dynamic_slam/map/landmark_projector.h"

#include <algorithm>
#include <cmath>

namespace dynamic_slam {
namespace {

// A view more than 60 deg from those that made the landmark shows it too differently.
constexpr float kMinViewCosine = 0.5f;

// Tolerance of the distances within which a landmark's octaves exist.
constexpr float kDistanceSlack = 1.2f;

}  // namespace

LandmarkProjector::LandmarkProjector(const Camera& camera, const std::vector<float>& octave_scales)
    : camera_(camera),
      bounds_(camera.IdealBounds()),
      last_octave_(static_cast<int>(octave_scales.size()) - 1),
      inverse_log_scale_factor_(octave_scales.size() > 1 ? 1.0f / std::log(octave_scales[1]) : 1.0f) {
  SetPose(Rigid3());
}

void LandmarkProjector::SetPose(const Rigid3& cam_from_world) {
  rotation_ = cam_from_world.Matrix();
  translation_ = cam_from_world.translation;
  center_ = cam_from_world.TargetOriginInSource();
}

bool LandmarkProjector::Project(const Eigen::Vector3d& x_in_world, const Eigen::Vector3f& normal,
                                float min_distance, float max_distance,
                                LandmarkProjection* projection) const {
  const Eigen::Vector3d x_in_cam = rotation_ * x_in_world + translation_;
  if (x_in_cam.z() <= 0) return false;
  projection->px = camera_.Project(x_in_cam);
  if (!IsInImage(projection->px)) return false;
  const Eigen::Vector3f ray = (x_in_world - center_).cast<float>();
  const float distance = ray.norm();
  if (distance * kDistanceSlack < min_distance || distance > kDistanceSlack * max_distance) return false;
  if (ray.dot(normal) < kMinViewCosine * distance) return false;
  const float octave = std::log(max_distance / distance) * inverse_log_scale_factor_;
  projection->octave = std::clamp(static_cast<int>(std::lround(octave)), 0, last_octave_);
  return true;
}

}  // namespace dynamic_slam
