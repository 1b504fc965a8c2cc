#include "dynamic_slam/viewer/replay.h"

#include <algorithm>

#include "dynamic_slam/base/text.h"

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
  const Message told = recording_.Read(0);
  // As MessageWriter::AddJson wrote it; what is no JSON becomes nothing.
  const size_t start = std::min(told->size(), kMessageHeaderBytes + sizeof(uint32_t));
  nlohmann::json hello =
      nlohmann::json::parse(told->begin() + static_cast<ptrdiff_t>(start), told->end(), nullptr, false);
  if (!hello.is_object()) hello = nlohmann::json::object();
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

void Replay::OnCommand(std::string_view command) {
  const size_t space = std::min(command.size(), command.find(' '));
  const std::string_view word = command.substr(0, space);
  const std::optional<double> number = ParseDouble(command.substr(std::min(command.size(), space + 1)));
  if (word == "pause" || word == "resume") {
    is_playing_ = word == "resume";
    if (is_playing_ && position_ + 1 == recording_.frames().size()) SeekTo(0);
    server_.Broadcast(Player());
  } else if (word == "step") {
    is_playing_ = false;
    Advance();
  } else if (word == "seek" && number.has_value() && *number >= 0 && *number < 1e9) {
    SeekTo(static_cast<size_t>(*number));
  } else if (word == "speed" && number.has_value() && *number >= 0.1 && *number <= 20) {
    speed_ = *number;
    server_.Broadcast(Player());
  } else {
    return;
  }
  ++turn_;
  PlayOn();
}

}  // namespace dynamic_slam
