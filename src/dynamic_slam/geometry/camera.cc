#include "dynamic_slam/geometry/camera.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <vector>

#include <Eigen/LU>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

// No keypoint fits into a smaller image.

// Distorted normalised coordinates and, when asked for, their 2x2 derivative.
Eigen::Vector2d DistortNormalised(const Camera& camera, const Eigen::Vector2d& x, Eigen::Matrix2d* jacobian) {
  const double r2 = x.squaredNorm();
  const double radial = 1.0 + r2 * (camera.k1 + r2 * (camera.k2 + r2 * camera.k3));
  const double xy = x.x() * x.y();
  const Eigen::Vector2d tangential(2.0 * camera.p1 * xy + camera.p2 * (r2 + 2.0 * x.x() * x.x()),
                                   camera.p1 * (r2 + 2.0 * x.y() * x.y()) + 2.0 * camera.p2 * xy);
  if (jacobian != nullptr) {
    const double d_radial = camera.k1 + r2 * (2.0 * camera.k2 + r2 * 3.0 * camera.k3);  // by r2
    const double cross = 2.0 * d_radial * xy + 2.0 * (camera.p1 * x.x() + camera.p2 * x.y());
    *jacobian << radial + 2.0 * d_radial * x.x() * x.x() + 2.0 * camera.p1 * x.y() + 6.0 * camera.p2 * x.x(),
        cross, cross,
        radial + 2.0 * d_radial * x.y() * x.y() + 6.0 * camera.p1 * x.y() + 2.0 * camera.p2 * x.x();
  }
  return radial * x + tangential;
}

// Distance from the principal point, in focal lengths, of a ray theta_rad from the optical axis.
double KannalaBrandtRadius(const Camera& c, double theta_rad, double* derivative) {
  const double t2 = theta_rad * theta_rad;
  *derivative = 1.0 + t2 * (3.0 * c.k1 + t2 * (5.0 * c.k2 + t2 * (7.0 * c.k3 + t2 * 9.0 * c.k4)));
  return theta_rad * (1.0 + t2 * (c.k1 + t2 * (c.k2 + t2 * (c.k3 + t2 * c.k4))));
}

struct Incidence {
  double rad;
  bool is_solution;  // otherwise rad is where the search ended: no smaller angle is one
};

// The smallest angle of which KannalaBrandtRadius is `radius`, up to 75 deg and as long as the radius grows
// with it. The polynomial may turn back beyond what the image shows, so the angle is bracketed from the axis
// outwards first.
Incidence IncidenceOf(const Camera& camera, double radius) {
  constexpr int kSteps = 80;
  constexpr double kStepRad = Camera::kMaxIncidenceRad / 64;  // a power of two: its multiples are exact
  double low = 0, high = 0, slope = 1;
  for (int step = 1;; ++step) {
    high = step * kStepRad;
    if (KannalaBrandtRadius(camera, high, &slope) >= radius) break;
    if (slope <= 0) return {low, false};
    if (step == kSteps) return {high, false};
    low = high;
  }
  double theta = 0.5 * (low + high);
  for (int iteration = 0; iteration < 50; ++iteration) {
    const double residual = KannalaBrandtRadius(camera, theta, &slope) - radius;
    if (std::abs(residual) < 1e-15) break;
    (residual > 0 ? high : low) = theta;
    theta -= residual / slope;
    if (!(theta >= low && theta <= high)) theta = 0.5 * (low + high);
  }
  return {theta, true};
}

Eigen::Vector2d UndistortKannalaBrandt(const Camera& camera, const Eigen::Vector2d& distorted) {
  const double radius = distorted.norm();
  return radius < 1e-12 ? distorted : distorted * (std::tan(IncidenceOf(camera, radius).rad) / radius);
}

Eigen::Vector2d DistortKannalaBrandt(const Camera& camera, const Eigen::Vector2d& x) {
  const double radius = x.norm();
  double unused;
  return radius < 1e-12 ? x : x * (KannalaBrandtRadius(camera, std::atan(radius), &unused) / radius);
}

std::vector<Eigen::Vector2d> BorderPixels(const Camera& camera) {
  std::vector<Eigen::Vector2d> pixels;
  // More for a fisheye, as the largest angle may cut its border anywhere.
  const int steps = camera.model == LensModel::kKannalaBrandt ? 512 : 32;
  const double right = camera.width - 1, bottom = camera.height - 1;
  for (int i = 0; i <= steps; ++i) {
    const double s = static_cast<double>(i) / steps;
    for (const Eigen::Vector2d& px : {Eigen::Vector2d(s * right, 0), Eigen::Vector2d(s * right, bottom),
                                      Eigen::Vector2d(0, s * bottom), Eigen::Vector2d(right, s * bottom)}) {
      pixels.push_back(px);
    }
  }
  return pixels;
}

}  // namespace

Eigen::Vector2d Camera::Distort(const Eigen::Vector2d& ideal_px) const {
  if (!HasDistortion()) return ideal_px;
  const Eigen::Vector2d x((ideal_px.x() - cx) / fx, (ideal_px.y() - cy) / fy);
  const Eigen::Vector2d distorted = model == LensModel::kKannalaBrandt ? DistortKannalaBrandt(*this, x)
                                                                       : DistortNormalised(*this, x, nullptr);
  return {fx * distorted.x() + cx, fy * distorted.y() + cy};
}

Eigen::Vector2d Camera::Undistort(const Eigen::Vector2d& raw_px) const {
  if (!HasDistortion()) return raw_px;
  const Eigen::Vector2d target((raw_px.x() - cx) / fx, (raw_px.y() - cy) / fy);
  if (model == LensModel::kKannalaBrandt) {
    const Eigen::Vector2d ideal = UndistortKannalaBrandt(*this, target);
    return {fx * ideal.x() + cx, fy * ideal.y() + cy};
  }
  Eigen::Vector2d x = target;
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix2d jacobian;
    const Eigen::Vector2d residual = DistortNormalised(*this, x, &jacobian) - target;
    if (residual.squaredNorm() * fx * fx < 1e-20) break;
    x -= jacobian.inverse() * residual;
  }
  return {fx * x.x() + cx, fy * x.y() + cy};
}

bool Camera::CanSee(const Eigen::Vector2d& raw_px) const {
  if (model != LensModel::kKannalaBrandt) return true;
  const Incidence incidence =
      IncidenceOf(*this, Eigen::Vector2d((raw_px.x() - cx) / fx, (raw_px.y() - cy) / fy).norm());
  return incidence.is_solution && incidence.rad <= kMaxIncidenceRad;
}

std::array<double, 4> Camera::IdealBounds() const {
  std::array<double, 4> bounds{0, 0, width - 1.0, height - 1.0};
  if (!HasDistortion()) return bounds;
  if (model == LensModel::kKannalaBrandt) bounds = {cx, cy, cx, cy};
  for (const Eigen::Vector2d& raw : BorderPixels(*this)) {
    Eigen::Vector2d ideal = Undistort(raw);
    if (!CanSee(raw)) {  // the last that can be seen in that direction
      const double tangent = Unproject(ideal).head<2>().norm();
      const double shrink = std::min(1.0, kMaxTangent / tangent);
      ideal = Eigen::Vector2d(cx, cy) + shrink * (ideal - Eigen::Vector2d(cx, cy));
    }
    bounds = {std::min(bounds[0], ideal.x()), std::min(bounds[1], ideal.y()), std::max(bounds[2], ideal.x()),
              std::max(bounds[3], ideal.y())};
  }
  return bounds;
}

void Camera::Validate() const {
  std::string problems;
  const auto require = [&problems](bool holds, const std::string& text) {
    if (!holds) problems += (problems.empty() ? "" : "; ") + text;
  };
  require(width > 0 && height > 0,
          fmt::format("width and height must be positive, are {} x {}", width, height));
  require(width <= 0 || height <= 0 || (width >= kMinSizePx && height >= kMinSizePx),
          fmt::format("width and height must be at least {}, are {} x {}", kMinSizePx, width, height));
  require(width <= kMaxSizePx && height <= kMaxSizePx,
          fmt::format("width and height must be at most {}, are {} x {}", kMaxSizePx, width, height));
  for (const auto& [name_of, focal] : {std::pair("fx", fx), std::pair("fy", fy)}) {
    require(std::isfinite(focal) && focal > 0, fmt::format("{} must be positive, is {}", name_of, focal));
    require(!(focal > 0) || !std::isfinite(focal) || (focal >= kMinFocalPx && focal <= kMaxFocalPx),
            fmt::format("{} must lie between {} and {}, is {}", name_of, kMinFocalPx, kMaxFocalPx, focal));
  }
  require(std::isfinite(cx) && cx > 0 && cx < width, fmt::format("cx must lie in the image, is {}", cx));
  require(std::isfinite(cy) && cy > 0 && cy < height, fmt::format("cy must lie in the image, is {}", cy));
  require(std::isfinite(fps) && fps >= 0, fmt::format("fps must not be negative, is {}", fps));
  require(readout_s >= 0 && readout_s <= kMaxReadout_s,
          fmt::format("readout_s must be from 0 to {}, is {}", kMaxReadout_s, readout_s));
  require(!(fps > kMaxFps), fmt::format("fps must be at most {}, is {}", kMaxFps, fps));
  bool finite = true;
  for (const double k : {k1, k2, p1, p2, k3, k4}) finite = finite && std::isfinite(k);
  require(finite, "distortion coefficients must be finite");
  const bool is_fisheye = model == LensModel::kKannalaBrandt;
  require(is_fisheye || k4 == 0, "k4 is no coefficient of the radial-tangential model");
  require(!is_fisheye || (p1 == 0 && p2 == 0), "p1 and p2 are no coefficients of the Kannala-Brandt model");
  if (problems.empty() && is_fisheye) {
    double farthest = 0;
    for (const Eigen::Vector2d& raw : BorderPixels(*this)) {
      farthest = std::max(farthest, std::hypot((raw.x() - cx) / fx, (raw.y() - cy) / fy));
    }
    const Incidence incidence = IncidenceOf(*this, farthest);
    require(incidence.is_solution || incidence.rad >= kMaxIncidenceRad,
            fmt::format(
                "the distortion cannot be inverted over the whole image: it turns back {:.0f} deg from the "
                "optical axis",
                incidence.rad * 180 / std::numbers::pi));
  } else if (problems.empty() && HasDistortion()) {
    bool invertible = true;
    for (const Eigen::Vector2d& raw : BorderPixels(*this)) {
      invertible = invertible && (Distort(Undistort(raw)) - raw).norm() < 1e-3;
    }
    require(invertible, "the distortion cannot be inverted over the whole image");
  }
  if (!problems.empty()) {
    throw InputError(fmt::format("camera '{}'", name), problems,
                     "Correct the camera file, or calibrate the camera again.");
  }
}

}  // namespace dynamic_slam
