#pragma once

#include <filesystem>

#include "dynamic_slam/sim/room.h"
#include "dynamic_slam/sim/scene_options.h"

namespace dynamic_slam {

// Throws InputError when the folder holds a sequence already.
void CheckHoldsNoSequence(const std::filesystem::path& folder);

// Writes the room as a sequence in TUM layout, with progress on a terminal, and prints one line about it.
void RenderRoom(const Room& room, const std::filesystem::path& folder);

// The same of a scene with all its truth (sim/simulation_writer.h); a sequence that is there is replaced.
void RenderScene(const SceneOptions& options, const std::filesystem::path& folder, bool with_depth = false);

}  // namespace dynamic_slam
