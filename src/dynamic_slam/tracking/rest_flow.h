#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "dynamic_slam/semantics/point_motion.h"

namespace dynamic_slam {

// How the image of what is at rest moves between two frames while no pose is known: what the keypoints in no
// box do. A similarity in place of the paper's mean displacement (Eq. 12), as the camera also rolls and
// advances.
class RestFlow {
 public:
  // motions: mostly of what is at rest. Nothing where they are few, or most of them do not go together.
  static std::optional<RestFlow> Fit(std::span<const PointMotion> motions);

  Eigen::Vector2d Move(const Eigen::Vector2d& px) const { return linear_ * (px - center_px_) + moved_px_; }

  // Of the place where Move puts a point, px^2 in each direction: the motions' own scatter, which is noise
  // and parallax, and the more the farther the point is from them.
  double Variance(const Eigen::Vector2d& px) const {
    return scatter_px2_ * (1 + (1 + (px - center_px_).squaredNorm() / spread_px2_) / count_);
  }

 private:
  Eigen::Matrix2d linear_;
  Eigen::Vector2d center_px_, moved_px_;
  double count_ = 0, scatter_px2_ = 0, spread_px2_ = 0;
};

}  // namespace dynamic_slam
