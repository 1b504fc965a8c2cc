#pragma once

#include <filesystem>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// Writes a part of the map as a model in COLMAP's text format: cameras.txt, images.txt and points3D.txt.
// Poses are cam_from_world, pixels are raw, and COLMAP's centre of the top left pixel is (0.5, 0.5), half a
// pixel from ours. Ids count from 1 in the order of ours. An image is named by its stamp, with six decimals,
// and ".png"; points are grey. Throws InputError when the folder cannot be written.
void WriteColmapModel(const std::filesystem::path& folder, const Camera& camera, const Map& map, PartId part);

}  // namespace dynamic_slam
