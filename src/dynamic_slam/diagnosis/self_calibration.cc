#include "dynamic_slam/diagnosis/self_calibration.h"

#include "dynamic_slam/system/sequence_runner.h"

namespace dynamic_slam {

std::optional<SelfCalibration> CalibrateByMap(const Camera& camera, FrameSource* source) {
  SystemOptions options;
  options.backfill = false;
  options.align_sightings = false;  // the keypoints are what is looked at
  SlamSystem system(camera, options);
  const RunSummary summary = RunSequence(*source, system);
  if (summary.failure != nullptr) std::rethrow_exception(summary.failure);
  const Trajectory frames = system.FrameTrajectory();
  const auto map = system.map().Read();
  if (map->Parts().empty()) return std::nullopt;
  return CalibrateByMap(system.camera(), *map, frames);
}

}  // namespace dynamic_slam
