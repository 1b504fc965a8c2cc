#include "dynamic_slam/mapping/map_calibration.h"

#include <algorithm>
#include <array>
#include <map>
#include <vector>

#include <ceres/ceres.h>

#include "dynamic_slam/geometry/rolling_shutter.h"
#include "dynamic_slam/optimize/reprojection_cost.h"

namespace dynamic_slam {
namespace {

using PoseBlock = std::array<double, kPoseBlockSize>;

// Reprojection error in sigmas: of a pose, a point in world, the factor on the focal lengths, what is to be
// added to the readout and to the lens's k1 and k2.
struct CalibrationCost {
  Eigen::Vector2d focal_px, from_center_px;
  Eigen::Vector2d row_flow_px;  // by which the keypoint goes back for each second of readout
  double inverse_sigma_px;

  template <class T>
  bool operator()(const T* pose, const T* point, const T* factor, const T* readout_s, const T* lens,
                  T* residuals) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(pose);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(pose + 4), x_in_world(point);
    const Eigen::Matrix<T, 3, 1> x = q * x_in_world + t;
    if (x.z() < T(kMinProjectionDepth)) return false;
    const T tangent2 = (x.x() * x.x() + x.y() * x.y()) / (x.z() * x.z());
    const T stretch = *factor * (T(1) + tangent2 * (lens[0] + tangent2 * lens[1]));
    for (int i = 0; i < 2; ++i) {
      const T seen = from_center_px[i] - *readout_s * row_flow_px[i];
      residuals[i] = (stretch * focal_px[i] * x[i] / x.z() - seen) * inverse_sigma_px;
    }
    return true;
  }
};

// Where the keypoint of a landmark goes for each second that the readout is longer, px.
Eigen::Vector2d RowFlow(const Camera& camera, const Keyframe& keyframe, const Keypoint& keypoint,
                        const Eigen::Vector3d& x_in_world, const std::map<double, SteadyMotion>& motions) {
  const double depth = (keyframe.cam_from_world() * x_in_world).z();
  const auto motion = motions.find(keyframe.timestamp_s());
  if (motion == motions.end() || depth < kMinProjectionDepth) return Eigen::Vector2d::Zero();
  constexpr double kStep_s = 1e-3;
  Camera rolling = camera;
  rolling.readout_s = kStep_s;
  const Eigen::Vector2d px(keypoint.x, keypoint.y);
  return (px - AtMiddleRow(rolling, motion->second, px, keypoint.raw_y, 1 / depth)) / kStep_s;
}

// Bundle adjustment of the first keyframes of a map and what they see, in which the camera's numbers can be
// free.
class CalibrationBundle {
 public:
  // frames: of which keyframes' motion is known.
  CalibrationBundle(const Camera& camera, const Map& map, const Trajectory& frames, size_t most_keyframes)
      : camera_(camera), motions_(MotionsAlong(frames)) {
    // At their ends it is known from one side only, and where a map begins frames are missing there.
    if (!frames.empty()) {
      motions_.erase(frames.front().timestamp_s);
      motions_.erase(frames.back().timestamp_s);
    }
    map.keyframes().ForEach([&](const Keyframe& keyframe) {
      if (keyframe.part() != map.Parts().front() || poses_.size() == most_keyframes) return;
      PoseBlock& block = poses_[keyframe.id()];
      Eigen::Map<Eigen::Quaterniond>(block.data()) = keyframe.cam_from_world().rotation;
      Eigen::Map<Eigen::Vector3d>(block.data() + 4) = keyframe.cam_from_world().translation;
    });
    if (poses_.size() < kFewestKeyframes) return;
    map.landmarks().ForEach([&](const Landmark& landmark) { AddLandmark(map, landmark); });
    if (points_.empty()) return;
    for (auto& [id, block] : poses_) {
      if (problem_.HasParameterBlock(block.data())) problem_.SetManifold(block.data(), new PoseManifold);
    }
    double* const origin = poses_.begin()->second.data();
    if (problem_.HasParameterBlock(origin)) problem_.SetParameterBlockConstant(origin);
    problem_.SetParameterLowerBound(&factor, 0, 0.2);
    problem_.SetParameterUpperBound(&factor, 0, 5);
    problem_.SetParameterLowerBound(&more_readout_s, 0, -camera.readout_s);
    problem_.SetParameterUpperBound(&more_readout_s, 0, Camera::kMaxReadout_s - camera.readout_s);
    for (double* number : {&factor, &more_readout_s, lens.data()}) problem_.SetParameterBlockConstant(number);
  }

  int Sightings() const { return problem_.NumResidualBlocks(); }

  // Returns the cost that is left with one of the camera's numbers free, or none of them: null.
  std::optional<double> Solve(double* free) {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.max_num_iterations = 50;
    options.logging_type = ceres::SILENT;
    if (free != nullptr) problem_.SetParameterBlockVariable(free);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    if (free != nullptr) problem_.SetParameterBlockConstant(free);
    return summary.IsSolutionUsable() ? std::optional(summary.final_cost) : std::nullopt;
  }

  double factor = 1, more_readout_s = 0;
  std::array<double, 2> lens{};

 private:
  static constexpr size_t kFewestKeyframes = 5, kFewestSightings = 3;

  void AddLandmark(const Map& map, const Landmark& landmark) {
    std::vector<Observation> seen;
    for (const Observation& observation : landmark.observations()) {
      if (poses_.contains(observation.keyframe)) seen.push_back(observation);
    }
    if (seen.size() < kFewestSightings) return;
    double* point = (points_[landmark.id()] = landmark.position()).data();
    for (const Observation& observation : seen) {
      const Keyframe& keyframe = map.keyframes().At(observation.keyframe);
      const Keypoint& keypoint = keyframe.keypoint(observation.keypoint);
      const double sigma_px = map.octave_scales()[static_cast<size_t>(keypoint.octave)];
      problem_.AddResidualBlock(
          new ceres::AutoDiffCostFunction<CalibrationCost, 2, kPoseBlockSize, 3, 1, 1, 2>(
              new CalibrationCost{{camera_.fx, camera_.fy},
                                  {keypoint.x - camera_.cx, keypoint.y - camera_.cy},
                                  RowFlow(camera_, keyframe, keypoint, landmark.position(), motions_),
                                  1 / sigma_px}),
          new ceres::HuberLoss(2), poses_.at(observation.keyframe).data(), point, &factor, &more_readout_s,
          lens.data());
    }
  }

  const Camera& camera_;
  std::map<double, SteadyMotion> motions_;  // by stamp
  ceres::Problem problem_;
  std::map<KeyframeId, PoseBlock> poses_;
  std::map<LandmarkId, Eigen::Vector3d> points_;
};

// Whether that is known; with_own: the cost with the camera as it is.
bool FindLens(const Camera& camera, double with_own, CalibrationBundle* bundle, SelfCalibration* found) {
  if (camera.model != LensModel::kRadialTangential) return true;  // its own is all that is known
  const std::optional<double> with_lens = bundle->Solve(bundle->lens.data());
  if (!with_lens) return false;
  found->k1 += bundle->lens[0];
  found->k2 += bundle->lens[1];
  found->lens_gain = 1 - *with_lens / with_own;
  bundle->lens = {};
  return true;
}

}  // namespace

std::optional<SelfCalibration> CalibrateByMap(const Camera& camera, const Map& map,
                                              const Trajectory& frames) {
  constexpr size_t kMostKeyframes = 120;
  CalibrationBundle bundle(camera, map, frames, kMostKeyframes);
  if (bundle.Sightings() == 0) return std::nullopt;
  const std::optional<double> with_own = bundle.Solve(nullptr),
                              with_readout = bundle.Solve(&bundle.more_readout_s);
  if (!with_own || !with_readout) return std::nullopt;
  SelfCalibration found{
      .readout_s = camera.readout_s + bundle.more_readout_s, .k1 = camera.k1, .k2 = camera.k2};
  found.readout_gain = 1 - *with_readout / *with_own;
  bundle.more_readout_s = 0;
  if (!FindLens(camera, *with_own, &bundle, &found)) return std::nullopt;
  const std::optional<double> with_focal = bundle.Solve(&bundle.factor);
  if (!with_focal) return std::nullopt;
  found.focal_factor = bundle.factor;
  found.focal_gain = 1 - *with_focal / *with_own;
  return found;
}

std::optional<SelfCalibration> CalibrateLensByMap(const Camera& camera, const Map& map) {
  constexpr size_t kMostKeyframes = 60;
  constexpr int kFewestSightings = 1000;  // of which two numbers explain a thousandth by chance
  if (camera.model != LensModel::kRadialTangential) return std::nullopt;
  CalibrationBundle bundle(camera, map, {}, kMostKeyframes);
  if (bundle.Sightings() < kFewestSightings) return std::nullopt;
  SelfCalibration found{.readout_s = camera.readout_s, .k1 = camera.k1, .k2 = camera.k2};
  const std::optional<double> with_own = bundle.Solve(nullptr);
  if (!with_own || !FindLens(camera, *with_own, &bundle, &found)) return std::nullopt;
  return found;
}

}  // namespace dynamic_slam
