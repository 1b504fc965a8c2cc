#pragma once

#include <filesystem>

#include "dynamic_slam/sim/room.h"

namespace dynamic_slam {

// Throws InputError when the folder holds a sequence already.
void CheckHoldsNoSequence(const std::filesystem::path& folder);

// Writes the room as a sequence in TUM layout, with progress on a terminal, and prints one line about it.
void RenderRoom(const Room& room, const std::filesystem::path& folder);

}  // namespace dynamic_slam
