#pragma once

#include <Eigen/Core>

#include <array>
#include <string>

namespace dynamic_slam {

// A pinhole camera with radial-tangential distortion (Brown; the coefficient order of OpenCV).
//
// The SLAM works in *ideal* pixels: what a distortion-free pinhole with the same fx, fy, cx, cy would see.
// Keypoints are undistorted once, at extraction. Pixel (0, 0) is the centre of the top left pixel.
struct Camera {
  std::string name;
  int width = 0;   // px, of the raw image
  int height = 0;  // px
  double fps = 0;  // frames per second; 0 when unknown
  double fx = 0, fy = 0, cx = 0, cy = 0;                       // px
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;               // radial k, tangential p

  bool HasDistortion() const { return k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0; }

  // Camera-frame point (z > 0) to ideal pixel.
  Eigen::Vector2d Project(const Eigen::Vector3d& x_in_cam) const {
    const double inverse_z = 1.0 / x_in_cam.z();
    return {fx * x_in_cam.x() * inverse_z + cx, fy * x_in_cam.y() * inverse_z + cy};
  }

  // Ideal pixel to the point of its ray at depth 1.
  Eigen::Vector3d Unproject(const Eigen::Vector2d& ideal_px) const {
    return {(ideal_px.x() - cx) / fx, (ideal_px.y() - cy) / fy, 1.0};
  }

  Eigen::Matrix3d Matrix() const {
    Eigen::Matrix3d K;
    K << fx, 0, cx, 0, fy, cy, 0, 0, 1;
    return K;
  }

  // Ideal pixel to raw pixel: applies the distortion.
  Eigen::Vector2d Distort(const Eigen::Vector2d& ideal_px) const;

  // Raw pixel to ideal pixel, to 1e-9 px, by Newton's method on Distort.
  Eigen::Vector2d Undistort(const Eigen::Vector2d& raw_px) const;

  // The ideal-pixel rectangle that holds every undistorted raw pixel: {min_x, min_y, max_x, max_y}.
  std::array<double, 4> IdealBounds() const;

  // Throws InputError naming each violated constraint (sizes and focal lengths positive and finite,
  // principal point inside the image, distortion invertible over the image).
  void Validate() const;
};

}  // namespace dynamic_slam
