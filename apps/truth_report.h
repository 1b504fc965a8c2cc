#pragma once

#include <filesystem>
#include <optional>

#include "dynamic_slam/report/truth_comparison.h"

namespace dynamic_slam {

// Ground truth beside the source. Nothing where there is none; also nothing, with the reason on the terminal,
// where it cannot be read, as the run is as good.
std::optional<Trajectory> FindTruth(const std::filesystem::path& source);

// Prints the error, also that of the frames tracked live (`live`, of the estimate), and draws trajectory.png
// into `out`; else, the reason why there is no error.
void ReportTruth(const Trajectory& truth, const Trajectory& estimate, const Trajectory& live,
                 const std::filesystem::path& out);

}  // namespace dynamic_slam
