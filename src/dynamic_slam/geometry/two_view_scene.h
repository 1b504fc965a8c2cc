#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "dynamic_slam/base/random.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// Synthetic matches for the tests of this folder.

inline Camera TestCamera() {
  Camera camera;
  camera.name = "test";
  camera.width = 640;
  camera.height = 480;
  camera.fx = 517;
  camera.fy = 516;
  camera.cx = 318;
  camera.cy = 255;
  return camera;
}

inline Camera TestCarCamera() {
  Camera camera;
  camera.name = "car";
  camera.width = 1241;
  camera.height = 376;
  camera.fx = camera.fy = 718.9;
  camera.cx = 607.2;
  camera.cy = 185.2;
  return camera;
}

inline double Degrees(double rad) { return rad * 180.0 / std::numbers::pi; }
inline double Radians(double deg) { return deg * std::numbers::pi / 180.0; }

struct MatchSet {
  std::vector<Eigen::Vector3d> points_in_first;  // true points
  std::vector<Eigen::Vector2d> first_px, second_px;
  std::vector<uint8_t> is_true;  // not an outlier, not moving
};

inline bool IsSeen(const Camera& camera, const Eigen::Vector3d& x_in_cam) {
  if (x_in_cam.z() < 0.1) return false;
  const Eigen::Vector2d px = camera.Project(x_in_cam);
  return px.x() >= 0 && px.y() >= 0 && px.x() <= camera.width - 1 && px.y() <= camera.height - 1;
}

inline Eigen::Vector2d RandomPixel(const Camera& camera, Random& random) {
  return {random.Uniform(0, camera.width - 1), random.Uniform(0, camera.height - 1)};
}

inline Eigen::Vector2d Noise(double sigma_px, Random& random) {
  const double x = random.Gaussian(), y = random.Gaussian();
  return sigma_px * Eigen::Vector2d(x, y);
}

// `count` matches of points with depth_of(pixel, random) in the first camera.
template <class DepthOf>
MatchSet MakeMatches(const Camera& camera, const Rigid3& second_from_first, int count, double sigma_px,
                     Random& random, DepthOf&& depth_of) {
  MatchSet set;
  while (static_cast<int>(set.first_px.size()) < count) {
    const Eigen::Vector2d px = RandomPixel(camera, random);
    const Eigen::Vector3d x = depth_of(px, random) * camera.Unproject(px);
    const Eigen::Vector3d x_in_second = second_from_first * x;
    if (!IsSeen(camera, x) || !IsSeen(camera, x_in_second)) continue;
    set.points_in_first.push_back(x);
    set.first_px.push_back(px + Noise(sigma_px, random));
    set.second_px.push_back(camera.Project(x_in_second) + Noise(sigma_px, random));
    set.is_true.push_back(1);
  }
  return set;
}

// Gives the first `count` matches a wrong second pixel anywhere in the image.
inline void MakeOutliers(const Camera& camera, int count, Random& random, MatchSet* set) {
  for (int i = 0; i < count; ++i) {
    set->second_px[i] = RandomPixel(camera, random);
    set->is_true[i] = 0;
  }
}

}  // namespace dynamic_slam
