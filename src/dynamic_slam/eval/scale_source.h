#pragma once

#include <filesystem>
#include <string>
#include <variant>

#include "dynamic_slam/geometry/metric_scale.h"
#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// What one camera cannot know, and its user can say: how long something is. Each states how far it can be
// wrong by what the map itself shows; that the user's length is exact is taken for granted.

// The camera was so far from where it had been.
struct KnownDistance {
  double first_s = 0, second_s = 0;  // stamps
  double metres = 0;                 // in a straight line
};

// The camera was so high above flat ground, upright to within some degrees, as on a car or a robot.
struct KnownHeight {
  double metres = 0;
};

// A trajectory of the same camera in metres.
struct KnownTrajectory {
  std::filesystem::path file;
};

using ScaleSource = std::variant<KnownDistance, KnownHeight, KnownTrajectory>;

// "distance:A,B,METRES", "camera-height:METRES" or "file:GT". Throws InputError.
ScaleSource ParseScaleSource(const std::string& text);

// From the positions of a trajectory at two times. Its error: how far the positions about these times scatter
// around a smooth path. Throws InputError when there is no pose near one of them, or the camera did not move.
MetricScale ScaleFromDistance(const Trajectory& trajectory, const KnownDistance& distance);

// From the planes that landmarks below the camera lie on, one about each keyframe of the part. Its error: how
// far these heights scatter. Throws InputError when the ground is not seen.
MetricScale ScaleFromHeight(const Map& map, PartId part, const KnownHeight& height, uint64_t seed);

// From the similarity that fits best (Umeyama 1991). Its error: by how much the scale changes when pieces of
// the trajectory are left out (jackknife). Throws InputError when the trajectories have too little in common.
MetricScale ScaleFromTrajectory(const Trajectory& trajectory, const Trajectory& metric,
                                const std::string& name);

}  // namespace dynamic_slam
