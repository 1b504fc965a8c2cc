#pragma once

#include <array>
#include <numbers>
#include <string>

#include <Eigen/Core>

#include "dynamic_slam/base/export.h"

namespace dynamic_slam {

// How a lens departs from a pinhole.
enum class LensModel {
  // Brown's: k1 k2 p1 p2 k3, as OpenCV.
  kRadialTangential,
  // Kannala and Brandt, "A generic camera model and calibration method" (2006): a ray at theta from the
  // optical axis
  // reaches the image at theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) from the principal
  // point, in
  // focal lengths; as cv::fisheye and Kalibr's "equidistant".
  kKannalaBrandt,
};

// A camera with a lens of one of the models.
//
// The SLAM works in *ideal* pixels: what a distortion-free pinhole with the same fx, fy, cx, cy would see.
// Keypoints are undistorted once, at extraction. Pixel (0, 0) is the centre of the top left pixel.
struct DYNAMIC_SLAM_API Camera {
  // What Validate takes, and a camera file too.
  static constexpr int kMinSizePx = 16, kMaxSizePx = 100000;
  static constexpr double kMinFocalPx = 1e-3, kMaxFocalPx = 1e6;
  static constexpr double kMaxFps = 1e5;
  static constexpr double kMaxReadout_s = 1;

  // Rays of a fisheye farther from the optical axis are not used: in the ideal image the noise of a pixel
  // grows along the radius with 1 / cos^2, 4 times at 60 deg.
  static constexpr double kMaxIncidenceRad = std::numbers::pi / 3;
  static constexpr double kMaxTangent = std::numbers::sqrt3;  // of it

  std::string name;
  int width = 0;                          // px, of the raw image
  int height = 0;                         // px
  double fps = 0;                         // frames per second; 0 when unknown
  double fx = 0, fy = 0, cx = 0, cy = 0;  // px
  LensModel model = LensModel::kRadialTangential;
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0,
         k4 = 0;  // p: radial-tangential only, k4: Kannala-Brandt only
  // From the exposure of the first row to that of the last (rolling shutter); 0: all at once.
  double readout_s = 0;

  // Whether ideal pixels differ from raw ones.
  bool HasDistortion() const {
    return model == LensModel::kKannalaBrandt || k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0;
  }

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

  // Raw pixel to ideal pixel, to 1e-9 px, by Newton's method on Distort. Where CanSee is false the answer is
  // the exact one up to 75 deg from the optical axis, and beyond that the pixel at 75 deg in the same
  // direction.
  Eigen::Vector2d Undistort(const Eigen::Vector2d& raw_px) const;

  // Whether the ray of the raw pixel may be used: within kMaxIncidenceRad. Always so for radial-tangential
  // lenses.
  bool CanSee(const Eigen::Vector2d& raw_px) const;

  // The same of an ideal pixel.
  bool CanSeeIdeal(const Eigen::Vector2d& ideal_px) const {
    return model != LensModel::kKannalaBrandt ||
           Unproject(ideal_px).head<2>().squaredNorm() <= kMaxTangent * kMaxTangent;
  }

  // The ideal-pixel rectangle that holds every undistorted raw pixel that CanSee: {min_x, min_y, max_x,
  // max_y}.
  std::array<double, 4> IdealBounds() const;

  // Throws InputError naming each violated constraint (sizes, focal lengths and rate within the limits,
  // principal point inside the image, no coefficients of the other model, distortion invertible over what the
  // image shows).
  void Validate() const;
};

}  // namespace dynamic_slam
