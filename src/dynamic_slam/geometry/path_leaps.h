#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "dynamic_slam/geometry/trajectory.h"

namespace dynamic_slam {

// From poses more frames apart nobody knows how the camera came from one to the other; a half more, as stamps
// are not even.
inline constexpr double kMaxGapFrames = 4.5;

// Frames in a row are no farther apart, in intervals.
inline constexpr double kNextFrame = 1.5;

// The median time from one pose to the next.
double MedianInterval_s(const Trajectory& path);

// How fast a camera can have been that had these speeds from pose to pose, in their unit: twice as fast as it
// nearly always was. Of too few nobody knows. Reorders them.
std::optional<double> MostSpeed(std::vector<double>* speeds);

// The longest step from one frame to the next that a camera on this path can have made, in its unit.
std::optional<double> LongestStep(const Trajectory& path);

// Where a camera cannot have come from one pose of its path to another as fast as the path says. Between them
// the map does not fit together, and what is on one side of the leap stands wrong.
struct PathLeap {
  // Of the poses, next to each other or nearly so, as a smooth path leaps in several steps.
  size_t first = 0, last = 0;
  double from_s = 0, to_s = 0;  // their stamps
  double times_too_fast = 1;    // its greatest speed, over the most that a camera can have had
};

// In the order of time. The path tells by itself how fast the camera was.
std::vector<PathLeap> FindLeaps(const Trajectory& path);

// The path cut at its leaps, each at its fastest step: for each pose the number of its piece, 0 that of the
// most poses. That one goes on after another when the camera can have come from one to the other.
std::vector<size_t> CutAt(const std::vector<PathLeap>& leaps, const Trajectory& path);

}  // namespace dynamic_slam
