#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// Where a landmark should show in a view, and in which octave.
struct LandmarkProjection {
  Eigen::Vector2d px;  // ideal
  int octave = 0;
};

// Tells of landmarks whether a view at a given pose can see them: before the camera, inside the image, from a
// distance and a direction that resemble those from which they have been seen.
class LandmarkProjector {
 public:
  LandmarkProjector(const Camera& camera, const std::vector<float>& octave_scales);

  void SetPose(const Rigid3& cam_from_world);

  bool Project(const Eigen::Vector3d& x_in_world, const Eigen::Vector3f& normal, float min_distance,
               float max_distance, LandmarkProjection* projection) const;

  // Inside the image and within the largest angle at which a fisheye's rays are used; px: ideal.
  bool IsInImage(const Eigen::Vector2d& px) const {
    return px.x() >= bounds_[0] && px.y() >= bounds_[1] && px.x() <= bounds_[2] && px.y() <= bounds_[3] &&
           camera_.CanSeeIdeal(px);
  }

 private:
  Camera camera_;
  std::array<double, 4> bounds_;
  int last_octave_;
  float inverse_log_scale_factor_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d translation_, center_;
};

}  // namespace dynamic_slam
