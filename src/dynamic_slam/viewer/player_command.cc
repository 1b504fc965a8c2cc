#include "dynamic_slam/viewer/player_command.h"

#include <algorithm>

#include "dynamic_slam/base/text.h"

namespace dynamic_slam {

std::optional<PlayerCommand> ParsePlayerCommand(std::string_view text) {
  using Kind = PlayerCommand::Kind;
  if (text == "pause") return PlayerCommand{Kind::kPause};
  if (text == "resume") return PlayerCommand{Kind::kResume};
  if (text == "step") return PlayerCommand{Kind::kStep};
  const size_t space = std::min(text.size(), text.find(' '));
  const std::string_view word = text.substr(0, space);
  const std::optional<double> number = ParseDouble(text.substr(std::min(text.size(), space + 1)));
  if (!number.has_value()) return std::nullopt;
  if (word == "seek" && *number >= 0 && *number < 1e9) return PlayerCommand{Kind::kSeek, *number};
  if (word == "speed" && *number >= 0.1 && *number <= 20) return PlayerCommand{Kind::kSpeed, *number};
  return std::nullopt;
}

}  // namespace dynamic_slam
