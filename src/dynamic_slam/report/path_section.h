#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "dynamic_slam/eval/metrics.h"
#include "dynamic_slam/geometry/sim3.h"
#include "dynamic_slam/geometry/trajectory.h"

namespace dynamic_slam {

// A path of a camera.
struct PathTrack {
  std::string name;
  std::string colour;                  // of the page: "c1" to "c6"; where errors are known they colour it
  Trajectory path;                     // world_from_cam
  Sim3 shown_from_world;               // the alignment with the truth
  std::vector<PoseError> errors = {};  // of some of the poses; empty: none are known
};

struct PathPicture {
  std::string title, note;
  double start_s = 0;                        // stamp of the moment 0
  std::optional<Trajectory> truth;           // in metres; without it the unit is the map's
  std::vector<PathTrack> tracks;             // at least one; the first is the one that the cursor follows
  std::vector<Eigen::Vector3f> points = {};  // landmarks, in the world of the first track
};

// The paths from above and from the side (Fig. 12 and 14), for ReportPage. Of a path of very many poses, each
// n-th.
nlohmann::ordered_json PathsSection(const PathPicture& picture);

}  // namespace dynamic_slam
