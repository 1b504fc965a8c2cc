#pragma once

#include <optional>
#include <string_view>

namespace dynamic_slam {

// What a browser wishes of a replay.
struct PlayerCommand {
  enum class Kind { kPause, kResume, kStep, kSeek, kSpeed };
  Kind kind = Kind::kPause;
  double number = 0;  // kSeek: frame, 0 to 1e9; kSpeed: factor, 0.1 to 20
};

// "pause", "resume", "step", "seek FRAME" or "speed FACTOR"; nothing for all else, which anybody may have
// sent.
std::optional<PlayerCommand> ParsePlayerCommand(std::string_view text);

}  // namespace dynamic_slam
