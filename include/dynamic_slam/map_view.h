#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/base/export.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/trajectory.h"

namespace dynamic_slam {

// A copy of what a map holds at one moment.
struct MapView {
  struct Landmark {
    uint32_t id = 0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  // in world
    int observations = 0;                                // keyframes that see it
    // Log of P(at rest) / P(moves), by how it was seen; 0 where nothing speaks for either.
    double static_log_odds = 0;
  };

  // Of one world and one unit of length. There is more than one part where tracking was lost, started anew
  // and saw nothing since that it knew before.
  struct Part {
    uint32_t id = 0;
    Trajectory keyframes;  // in the order of time
    std::vector<Landmark> landmarks;
  };

  Camera camera;            // of the prepared images
  std::vector<Part> parts;  // the one with the most keyframes first
};

// Reads a file that System::SaveMap or `dynamic_slam run --save-map` wrote. Throws InputError.
DYNAMIC_SLAM_API MapView ReadMap(const std::filesystem::path& file);

// Writes a part of a map file, counted from 1 in the order of MapView::parts, into the folder: map.ply,
// keyframes.txt (TUM format) and colmap/, a model in COLMAP's text format. Returns the part. Throws
// InputError.
DYNAMIC_SLAM_API MapView::Part ExportMap(const std::filesystem::path& file,
                                         const std::filesystem::path& folder, int part = 1);

}  // namespace dynamic_slam
