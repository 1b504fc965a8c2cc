#include "dynamic_slam/viewer/replay.h"

#include <algorithm>

#include "dynamic_slam/viewer/player_command.h"

namespace dynamic_slam {
namespace {

bool IsWholeMap(const MessageHeader& header) {
  return header.type == MessageType::kMap && header.detail == 1;
}

}  // namespace

Replay::Replay(const std::filesystem::path& file, const ServerOptions& options)
    : recording_(file), server_(options, this) {
  server_.Start();
  server_.Post([this] { PlayOn(); });
}

Message Replay::Hello() {
  nlohmann::json hello = recording_.Hello();
  hello["mode"] = "replay";
  nlohmann::json& states = hello["states"] = nlohmann::json::array();
  for (const size_t frame : recording_.frames()) states.push_back(recording_.entries()[frame].header.detail);
  return JsonMessage(MessageType::kHello, 0, hello);
}

Message Replay::Player() const {
  return JsonMessage(MessageType::kPlayer, static_cast<uint32_t>(position_),
                     {{"paused", !is_playing_}, {"position", position_}, {"speed", speed_}});
}

std::vector<Message> Replay::Backlog() {
  const std::vector<RecordingReader::Entry>& entries = recording_.entries();
  const size_t now = recording_.frames()[position_];
  std::vector<Message> messages{Hello()};
  size_t whole = 0;
  for (size_t i = 0; i < now; ++i) {
    if (IsWholeMap(entries[i].header)) whole = i;
  }
  for (size_t i = 0; i < now; ++i) {
    const MessageType type = entries[i].header.type;
    if (type == MessageType::kEvent || (type == MessageType::kMap && i >= whole))
      messages.push_back(recording_.Read(i));
  }
  messages.push_back(recording_.Read(now));
  messages.push_back(Player());
  return messages;
}

void Replay::Advance() {
  const std::vector<size_t>& frames = recording_.frames();
  if (position_ + 1 >= frames.size()) {
    is_playing_ = false;
  } else {
    const size_t from = frames[position_];
    ++position_;
    for (size_t i = from + 1; i <= frames[position_]; ++i) {
      if (!IsWholeMap(recording_.entries()[i].header)) server_.Broadcast(recording_.Read(i));
    }
  }
  server_.Broadcast(Player());
}

void Replay::SeekTo(size_t frame) {
  position_ = std::min(frame, recording_.frames().size() - 1);
  server_.Refresh();
}

void Replay::PlayOn() {
  if (!is_playing_ || position_ + 1 >= recording_.frames().size()) return;
  const auto stamp = [this](size_t frame) {
    return recording_.entries()[recording_.frames()[frame]].timestamp_s;
  };
  const double pause_s = std::clamp((stamp(position_ + 1) - stamp(position_)) / speed_, 0.005, 1.0);
  server_.PostAfter(std::chrono::milliseconds(static_cast<int>(1000 * pause_s)), [this, turn = turn_] {
    if (turn != turn_) return;
    Advance();
    PlayOn();
  });
}

void Replay::OnCommand(std::string_view text) {
  using Kind = PlayerCommand::Kind;
  const std::optional<PlayerCommand> command = ParsePlayerCommand(text);
  if (!command.has_value()) return;
  switch (command->kind) {
    case Kind::kPause:
    case Kind::kResume:
      is_playing_ = command->kind == Kind::kResume;
      if (is_playing_ && position_ + 1 == recording_.frames().size()) SeekTo(0);
      server_.Broadcast(Player());
      break;
    case Kind::kStep:
      is_playing_ = false;
      Advance();
      break;
    case Kind::kSeek:
      SeekTo(static_cast<size_t>(command->number));
      break;
    case Kind::kSpeed:
      speed_ = command->number;
      server_.Broadcast(Player());
      break;
  }
  ++turn_;
  PlayOn();
}

}  // namespace dynamic_slam
