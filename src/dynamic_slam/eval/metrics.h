#pragma once

#include <string>
#include <vector>

#include "dynamic_slam/base/export.h"
#include "dynamic_slam/eval/pose_list.h"
#include "dynamic_slam/geometry/sim3.h"

namespace dynamic_slam {

// Trajectory errors with the definitions of evo (github.com/MichaelGrupp/evo), the tool of the paper's
// tables: equal to its results to about 1e-12. After Sturm et al., "A benchmark for the evaluation of RGB-D
// SLAM systems" (2012).

enum class Alignment { kNone, kSe3, kSim3 };
enum class DeltaUnit { kFrames, kMetres };

struct RpeOptions {
  double delta = 1;  // > 0; a whole number when the unit is frames
  DeltaUnit delta_unit = DeltaUnit::kFrames;
};

// Two lists of equal length; element i of one belongs to element i of the other.
struct MatchedPoses {
  PoseList reference;
  PoseList estimate;
};

struct ErrorStatistics {
  size_t n = 0;  // number of errors
  double rmse = 0, mean = 0, median = 0, std = 0, min = 0, max = 0;
  double sse = 0;  // sum of squared errors; std is the population's
};

// One of the errors; of a relative one, the pose at which the motion ends.
struct PoseError {
  double timestamp_s = 0;  // of the estimate
  double translation_m = 0, rotation_deg = 0;
};

struct TrajectoryErrors {
  ErrorStatistics translation_m;
  ErrorStatistics rotation_deg;
  Sim3 reference_from_estimate;   // the alignment that was applied; its scale is evo's
  std::vector<PoseError> errors;  // in order
};

// For each pose of the shorter list (the estimate, when they are equally long) the pose of the longer one
// that is nearest in time, if it is within max_dt_s. A pose of the longer list may be taken twice. Both
// ordered by time. Throws InputError when nothing matches.
DYNAMIC_SLAM_API MatchedPoses MatchByTime(const PoseList& reference, const PoseList& estimate,
                                          double max_dt_s);

// Row by row. Throws InputError when the lengths differ.
DYNAMIC_SLAM_API MatchedPoses MatchByRow(const PoseList& reference, const PoseList& estimate);

// Absolute pose error: each estimated pose against its reference, after the alignment of all positions.
// Throws InputError when the alignment is not determined (fewer than 3 positions, or all on one line).
DYNAMIC_SLAM_API TrajectoryErrors AbsolutePoseError(const MatchedPoses& poses, Alignment alignment);

// Relative pose error: after the alignment, motions of the estimate against those of the reference, between
// poses i, j with j - i = delta frames, or with delta metres along the *estimate* between them, one pair
// beginning where the last one ended. As in evo, the first pair by metres begins only after delta metres.
// Throws InputError as above, and when there is no such pair.
DYNAMIC_SLAM_API TrajectoryErrors RelativePoseError(const MatchedPoses& poses, Alignment alignment,
                                                    const RpeOptions& options);

// Empty `errors` give zeros.
ErrorStatistics Summarise(std::vector<double> errors);

}  // namespace dynamic_slam
