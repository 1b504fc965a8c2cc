#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// Matches between points of the map and keypoints of one frame, as arrays so that the inner loop runs on
// consecutive numbers. Keep one object and Clear() it between frames: nothing is allocated after the first.
struct PoseObservations {
  std::vector<double> x, y, z;  // point in world
  // How far the point may be off along a line: one standard deviation, in world.
  std::vector<double> spread_x, spread_y, spread_z;
  std::vector<double> u, v;              // ideal px
  std::vector<double> inverse_sigma_px;  // 1 / (standard deviation of the keypoint: the scale of its octave)
  std::vector<double> weight;            // trust in the match: 1 is certain, 0 is not used

  void Clear();
  void Add(const Eigen::Vector3d& x_in_world, const Eigen::Vector2d& ideal_px, double inverse_sigma,
           double trust = 1.0, const Eigen::Vector3d& spread_in_world = Eigen::Vector3d::Zero());
  // Takes an observation's numbers away, whatever they are: it has no weight then.
  void Discard(size_t i);
  size_t size() const { return x.size(); }
};

struct PoseOptimizerOptions {
  int robust_rounds = 3;
  int plain_rounds = 2;
  int iterations_per_round = 10;
  double chi2 = 5.991;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit(
        "robust_rounds", self.robust_rounds,
        OptionField{"", 1, 10,
                    "Rounds with a Huber kernel; outliers are named again after each, ever more strictly."});
    visit("plain_rounds", self.plain_rounds, OptionField{"", 0, 10, "Rounds after that, without a kernel."});
    visit("iterations_per_round", self.iterations_per_round,
          OptionField{"", 1, 100, "Most steps in a round; small steps end it sooner."});
    visit("chi2", self.chi2,
          OptionField{"", 0.1, 100, "A squared error above this, in sigmas, makes an outlier (95%: 5.991)."});
  }
};

// What PoseOptimizer found. With `converged` false the pose is the initial one and there are no inliers.
struct PoseEstimate {
  Rigid3 cam_from_world;
  int inliers = 0;
  std::vector<uint8_t> is_inlier;  // one for each observation
  double rms_px = 0;               // of the inliers, per observation, in sigmas
  // J^T W J of the inliers at the pose, in the order (rotation vector, translation) of an increment
  // multiplied from the left; its inverse is the covariance.
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  bool converged = false;
};

// The share of the inliers that can be right matches, by how near they are: of a squared error of up to
// `chi2`, in sigmas, matches by chance have half in the mean, and right ones what is left of a Gaussian. 0
// to 1.
double RightShare(const PoseEstimate& estimate, double chi2);

// Finds the camera pose that minimises the reprojection error of known points: Eq. (10) of the paper, with
// a Huber kernel, per-octave sigmas, weights, and outliers that are named anew after each round.
//
// Where a point was triangulated from views that lie close together, its depth is uncertain, and taking it
// for certain shortens the camera's motion (errors in variables): the scale of the map would shrink with each
// generation of points. So an error counts the less the more of it the point's spread can explain. Outliers
// are named without that, as wrong matches lie on the same line.
class PoseOptimizer {
 public:
  explicit PoseOptimizer(const Camera& camera, const PoseOptimizerOptions& options = {});

  // Fewer than 3 usable points, or numbers that are not finite, give converged = false; never throws for
  // data. A point behind the camera, or one with a non-finite number, is an outlier.
  void Optimize(const PoseObservations& observations, const Rigid3& initial_cam_from_world,
                PoseEstimate* estimate);

 private:
  // Copies the observations into active_, padded to whole blocks; those that cannot be used get no weight.
  void Copy(const PoseObservations& all);

  // Gives the inliers among active_ their weights and all others none; returns their number.
  int Activate(const PoseObservations& all, const std::vector<uint8_t>& is_inlier);

  // Takes Levenberg-Marquardt steps on active_ until they are small. False: the geometry is degenerate.
  bool Descend(bool robust, Rigid3* cam_from_world) const;

  // Names the inliers among all observations at this pose and counts them; true if a flag changed.
  bool Classify(const PoseObservations& all, double chi2, PoseEstimate* estimate) const;

  double fx_, fy_, cx_, cy_;  // px
  PoseOptimizerOptions options_;
  PoseObservations active_;
  std::vector<uint8_t> is_usable_;
};

}  // namespace dynamic_slam
