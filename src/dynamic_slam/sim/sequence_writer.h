#pragma once

#include <filesystem>
#include <functional>

#include "dynamic_slam/sim/room.h"

namespace dynamic_slam {

// Writes a room's frames in the layout of TUM RGB-D: rgb/*.jpg (quality 95), rgb.txt, groundtruth.txt with
// the pose of each frame, camera.yaml. `on_frame` is told how many frames are written. rgb.txt, which makes
// the folder a sequence, comes last. Throws InputError when something cannot be written.
void WriteTumSequence(const Room& room, const std::filesystem::path& folder,
                      const std::function<void(int)>& on_frame = {});

}  // namespace dynamic_slam
