#include "dynamic_slam/eval/metrics.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/geometry/umeyama.h"

namespace dynamic_slam {
namespace {

// Index of the pose nearest in time; the earlier one of two equally near. `poses` is ordered and not empty.
size_t Nearest(const PoseList& poses, double timestamp_s) {
  const auto later = std::lower_bound(poses.begin(), poses.end(), timestamp_s,
                                      [](const EvalPose& pose, double t) { return pose.timestamp_s < t; });
  const size_t index = static_cast<size_t>(later - poses.begin());
  if (index == poses.size()) return index - 1;
  if (index == 0) return 0;
  const bool earlier_is_near =
      timestamp_s - poses[index - 1].timestamp_s <= poses[index].timestamp_s - timestamp_s;
  return earlier_is_near ? index - 1 : index;
}

double RotationAngleDeg(const Eigen::Matrix3d& rotation) {
  return LogSo3(Eigen::Quaterniond(rotation).normalized()).norm() * 180.0 / std::numbers::pi;
}

// target_from_source of two poses in a common frame, with the transpose for the inverse, as in evo.
EvalPose Between(const EvalPose& target, const EvalPose& source) {
  const Eigen::Matrix3d inverse = target.rotation.transpose();
  return {0, inverse * source.rotation, inverse * (source.position - target.position)};
}

// Moves the estimate onto the reference and returns how.
Sim3 Align(MatchedPoses& poses, Alignment alignment) {
  Sim3 reference_from_estimate;
  if (alignment == Alignment::kNone) return reference_from_estimate;
  std::vector<Eigen::Vector3d> source, target;
  for (const EvalPose& pose : poses.estimate) source.push_back(pose.position);
  for (const EvalPose& pose : poses.reference) target.push_back(pose.position);
  const auto found = AlignUmeyama(source, target, alignment == Alignment::kSim3);
  if (!found) {
    throw InputError("alignment",
                     fmt::format("{} matched positions, all on one line, do not determine it", source.size()),
                     "Judge a longer trajectory, or use --align none.");
  }
  reference_from_estimate = *found;
  const Eigen::Matrix3d R = reference_from_estimate.rotation.toRotationMatrix();
  for (EvalPose& pose : poses.estimate) {
    pose.position = reference_from_estimate * pose.position;
    pose.rotation = R * pose.rotation;
  }
  return reference_from_estimate;
}

void SummariseErrors(TrajectoryErrors* result) {
  std::vector<double> translation_m, rotation_deg;
  for (const PoseError& error : result->errors) {
    translation_m.push_back(error.translation_m);
    rotation_deg.push_back(error.rotation_deg);
  }
  result->translation_m = Summarise(std::move(translation_m));
  result->rotation_deg = Summarise(std::move(rotation_deg));
}

std::vector<std::pair<size_t, size_t>> PairsAtDelta(const PoseList& estimate, const RpeOptions& options) {
  std::vector<size_t> ends;
  if (options.delta_unit == DeltaUnit::kFrames) {
    const size_t step = static_cast<size_t>(options.delta);
    for (size_t i = 0; i < estimate.size(); i += step) ends.push_back(i);
  } else {
    double path_m = 0;
    for (size_t i = 1; i < estimate.size(); ++i) {
      path_m += (estimate[i].position - estimate[i - 1].position).norm();
      if (path_m < options.delta) continue;
      ends.push_back(i);
      path_m = 0;
    }
  }
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t k = 1; k < ends.size(); ++k) pairs.emplace_back(ends[k - 1], ends[k]);
  return pairs;
}

}  // namespace

MatchedPoses MatchByTime(const PoseList& reference, const PoseList& estimate, double max_dt_s) {
  const bool estimate_is_longer = estimate.size() > reference.size();
  const PoseList& longer = estimate_is_longer ? estimate : reference;
  const PoseList& shorter = estimate_is_longer ? reference : estimate;
  MatchedPoses matched;
  if (!longer.empty()) {
    for (const EvalPose& pose : shorter) {
      const EvalPose& near = longer[Nearest(longer, pose.timestamp_s)];
      if (std::abs(near.timestamp_s - pose.timestamp_s) > max_dt_s) continue;
      matched.reference.push_back(estimate_is_longer ? pose : near);
      matched.estimate.push_back(estimate_is_longer ? near : pose);
    }
  }
  if (matched.estimate.empty()) {
    const auto span = [](const PoseList& poses) {
      return poses.empty()
                 ? std::string("empty")
                 : fmt::format("{:.3f} to {:.3f} s", poses.front().timestamp_s, poses.back().timestamp_s);
    };
    throw InputError("trajectories",
                     fmt::format("no two poses within {} s: ground truth {}, estimate {}", max_dt_s,
                                 span(reference), span(estimate)),
                     "Give files with the same clock, or a larger --max-dt.");
  }
  return matched;
}

MatchedPoses MatchByRow(const PoseList& reference, const PoseList& estimate) {
  if (reference.size() != estimate.size()) {
    throw InputError("trajectories",
                     fmt::format("ground truth has {} rows, estimate {}", reference.size(), estimate.size()),
                     "Rows are matched one by one; for an estimate with gaps use its TUM file and --times.");
  }
  return {reference, estimate};
}

TrajectoryErrors AbsolutePoseError(const MatchedPoses& poses, Alignment alignment) {
  MatchedPoses aligned = poses;
  TrajectoryErrors result;
  result.reference_from_estimate = Align(aligned, alignment);
  for (size_t i = 0; i < aligned.estimate.size(); ++i) {
    const EvalPose error = Between(aligned.reference[i], aligned.estimate[i]);
    result.errors.push_back({aligned.estimate[i].timestamp_s,
                             (aligned.estimate[i].position - aligned.reference[i].position).norm(),
                             RotationAngleDeg(error.rotation)});
  }
  SummariseErrors(&result);
  return result;
}

TrajectoryErrors RelativePoseError(const MatchedPoses& poses, Alignment alignment,
                                   const RpeOptions& options) {
  const bool whole = options.delta >= 1 && options.delta == std::floor(options.delta) && options.delta <= 1e9;
  if (options.delta_unit == DeltaUnit::kFrames && !whole) {
    throw InputError("--delta", fmt::format("{} is not a whole number of frames", options.delta),
                     "Give 1 or more.");
  }
  if (!(options.delta > 0)) throw InputError("--delta", fmt::format("{} is not positive", options.delta), "");
  MatchedPoses aligned = poses;
  TrajectoryErrors result;
  result.reference_from_estimate = Align(aligned, alignment);
  for (const auto& [i, j] : PairsAtDelta(aligned.estimate, options)) {
    const EvalPose error = Between(Between(aligned.reference[i], aligned.reference[j]),
                                   Between(aligned.estimate[i], aligned.estimate[j]));
    result.errors.push_back(
        {aligned.estimate[j].timestamp_s, error.position.norm(), RotationAngleDeg(error.rotation)});
  }
  if (result.errors.empty()) {
    const char* unit = options.delta_unit == DeltaUnit::kFrames ? "frames" : "m";
    throw InputError("--delta",
                     fmt::format("no two of the {} matched poses are {} {} apart", poses.estimate.size(),
                                 options.delta, unit),
                     "Give a smaller --delta.");
  }
  SummariseErrors(&result);
  return result;
}

ErrorStatistics Summarise(std::vector<double> errors) {
  ErrorStatistics s;
  s.n = errors.size();
  if (errors.empty()) return s;
  const double n = static_cast<double>(s.n);
  std::sort(errors.begin(), errors.end());
  for (const double e : errors) {
    s.mean += e / n;
    s.sse += e * e;
  }
  for (const double e : errors) s.std += (e - s.mean) * (e - s.mean);
  s.std = std::sqrt(s.std / n);
  s.rmse = std::sqrt(s.sse / n);
  s.min = errors.front();
  s.max = errors.back();
  const size_t middle = s.n / 2;
  s.median = s.n % 2 == 1 ? errors[middle] : 0.5 * (errors[middle - 1] + errors[middle]);
  return s;
}

}  // namespace dynamic_slam
