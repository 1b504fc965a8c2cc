#include "dynamic_slam/tracking/rest_flow.h"

#include <algorithm>
#include <vector>

#include <opencv2/calib3d.hpp>

namespace dynamic_slam {
namespace {

constexpr size_t kMinMotions = 12;

// Of the motions so many must go together: else nobody knows which of them are of what is at rest.
constexpr double kMinShare = 0.5;

// Three sigmas of the noise of both ends, a pixel each.
constexpr double kGate_px = 4.2;

// The noise of both ends, px^2: what fits better does so by chance.
constexpr double kNoise_px2 = 2;

}  // namespace

std::optional<RestFlow> RestFlow::Fit(std::span<const PointMotion> motions) {
  if (motions.size() < kMinMotions) return std::nullopt;
  std::vector<cv::Point2f> from, to;
  for (const PointMotion& motion : motions) {
    from.emplace_back(static_cast<float>(motion.from_px.x()), static_cast<float>(motion.from_px.y()));
    to.emplace_back(static_cast<float>(motion.to_px.x()), static_cast<float>(motion.to_px.y()));
  }
  std::vector<uint8_t> fits;
  const cv::Mat affine = cv::estimateAffinePartial2D(from, to, fits, cv::RANSAC, kGate_px);
  const auto count = static_cast<size_t>(std::count(fits.begin(), fits.end(), uint8_t{1}));
  if (affine.empty() || count < kMinMotions ||
      static_cast<double>(count) < kMinShare * static_cast<double>(motions.size())) {
    return std::nullopt;
  }
  RestFlow flow;
  flow.count_ = static_cast<double>(count);
  flow.linear_ << affine.at<double>(0, 0), affine.at<double>(0, 1), affine.at<double>(1, 0),
      affine.at<double>(1, 1);
  flow.center_px_.setZero();
  for (size_t i = 0; i < motions.size(); ++i) {
    if (fits[i] != 0) flow.center_px_ += motions[i].from_px / flow.count_;
  }
  flow.moved_px_ =
      flow.linear_ * flow.center_px_ + Eigen::Vector2d(affine.at<double>(0, 2), affine.at<double>(1, 2));
  double scatter = 0, spread = 0;
  for (size_t i = 0; i < motions.size(); ++i) {
    if (fits[i] == 0) continue;
    scatter += 0.5 * (motions[i].to_px - flow.Move(motions[i].from_px)).squaredNorm();
    spread += (motions[i].from_px - flow.center_px_).squaredNorm();
  }
  flow.scatter_px2_ = std::max(scatter / flow.count_, kNoise_px2);
  flow.spread_px2_ = std::max(spread / flow.count_, 1.0);
  return flow;
}

}  // namespace dynamic_slam
