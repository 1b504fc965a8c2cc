#include "dynamic_slam/geometry/camera.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <vector>

#include <Eigen/LU>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

// No keypoint fits into a smaller image.
constexpr int kMinSizePx = 16;

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

std::vector<Eigen::Vector2d> BorderPixels(const Camera& camera) {
  std::vector<Eigen::Vector2d> pixels;
  constexpr int kSteps = 32;
  const double right = camera.width - 1, bottom = camera.height - 1;
  for (int i = 0; i <= kSteps; ++i) {
    const double s = static_cast<double>(i) / kSteps;
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
  const Eigen::Vector2d distorted = DistortNormalised(*this, x, nullptr);
  return {fx * distorted.x() + cx, fy * distorted.y() + cy};
}

Eigen::Vector2d Camera::Undistort(const Eigen::Vector2d& raw_px) const {
  if (!HasDistortion()) return raw_px;
  const Eigen::Vector2d target((raw_px.x() - cx) / fx, (raw_px.y() - cy) / fy);
  Eigen::Vector2d x = target;
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Matrix2d jacobian;
    const Eigen::Vector2d residual = DistortNormalised(*this, x, &jacobian) - target;
    if (residual.squaredNorm() * fx * fx < 1e-20) break;
    x -= jacobian.inverse() * residual;
  }
  return {fx * x.x() + cx, fy * x.y() + cy};
}

std::array<double, 4> Camera::IdealBounds() const {
  std::array<double, 4> bounds{0, 0, width - 1.0, height - 1.0};
  if (!HasDistortion()) return bounds;
  for (const Eigen::Vector2d& raw : BorderPixels(*this)) {
    const Eigen::Vector2d ideal = Undistort(raw);
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
  require(std::isfinite(fx) && fx > 0, fmt::format("fx must be positive, is {}", fx));
  require(std::isfinite(fy) && fy > 0, fmt::format("fy must be positive, is {}", fy));
  require(std::isfinite(cx) && cx > 0 && cx < width, fmt::format("cx must lie in the image, is {}", cx));
  require(std::isfinite(cy) && cy > 0 && cy < height, fmt::format("cy must lie in the image, is {}", cy));
  require(std::isfinite(fps) && fps >= 0, fmt::format("fps must not be negative, is {}", fps));
  bool finite = true;
  for (const double k : {k1, k2, p1, p2, k3}) finite = finite && std::isfinite(k);
  require(finite, "distortion coefficients must be finite");
  if (problems.empty() && HasDistortion()) {
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
