#include "dynamic_slam/viewer/recording.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

constexpr std::array<char, 8> kMagic = {'D', 'S', 'V', 'I', 'E', 'W', '0', '1'};
constexpr uint32_t kMaxMessageBytes = 256u << 20;

// Before each message.
struct Prefix {
  double timestamp_s;
  uint32_t bytes;
  uint32_t zero;
};
static_assert(sizeof(Prefix) == 16);

}  // namespace

RecordingWriter::RecordingWriter(std::filesystem::path file)
    : file_(std::move(file)), stream_(file_, std::ios::binary) {
  stream_.write(kMagic.data(), kMagic.size());
  if (!stream_.flush())
    throw InputError(file_.string(), "cannot be written", "Check the folder and its rights.");
}

void RecordingWriter::Add(double timestamp_s, const Message& message) {
  const Prefix prefix{timestamp_s, static_cast<uint32_t>(message->size()), 0};
  stream_.write(reinterpret_cast<const char*>(&prefix), sizeof(prefix));
  stream_.write(message->data(), static_cast<std::streamsize>(message->size()));
  // At once, so that the last messages are not lost without a word.
  if (!stream_.flush()) throw InputError(file_.string(), "cannot be written any more", "Is the disk full?");
}

RecordingReader::RecordingReader(const std::filesystem::path& file)
    : name_(file.string()), stream_(file, std::ios::binary) {
  if (!stream_)
    throw InputError(name_, "there is no recording", "Make one with `dynamic_slam run ... --record`.");
  stream_.seekg(0, std::ios::end);
  const auto size = static_cast<uint64_t>(stream_.tellg());
  stream_.seekg(0);
  std::array<char, kMagic.size()> magic{};
  stream_.read(magic.data(), magic.size());
  if (!stream_ || magic != kMagic) {
    throw InputError(name_, "is no recording of this version", "Record the run again with --record.");
  }
  uint64_t at = kMagic.size();
  std::array<char, kMessageHeaderBytes> start{};
  while (at + sizeof(Prefix) + kMessageHeaderBytes <= size) {
    Prefix prefix{};
    stream_.seekg(static_cast<std::streamoff>(at));
    stream_.read(reinterpret_cast<char*>(&prefix), sizeof(prefix));
    stream_.read(start.data(), start.size());
    at += sizeof(Prefix);
    if (!stream_ || prefix.bytes < kMessageHeaderBytes || prefix.bytes > kMaxMessageBytes ||
        !std::isfinite(prefix.timestamp_s) || prefix.bytes > size - at) {
      break;
    }
    const MessageHeader header = HeaderOf({start.data(), start.size()});
    if (header.type == MessageType::kFrame) frames_.push_back(entries_.size());
    entries_.push_back({header, prefix.timestamp_s, at, prefix.bytes});
    at += prefix.bytes;
  }
  if (entries_.empty() || entries_.front().header.type != MessageType::kHello || frames_.empty()) {
    throw InputError(name_, "has no frames", "Record the run again with --record.");
  }
}

Message RecordingReader::Read(size_t entry) {
  const Entry& e = entries_.at(entry);
  std::string bytes(e.bytes, '\0');
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(e.offset));
  stream_.read(bytes.data(), e.bytes);
  if (!stream_) throw InputError(name_, "cannot be read any more", "Was it changed meanwhile?");
  return std::make_shared<const std::string>(std::move(bytes));
}

nlohmann::json RecordingReader::Hello() {
  const Message told = Read(0);
  // As MessageWriter::AddJson wrote it.
  const size_t start = std::min(told->size(), kMessageHeaderBytes + sizeof(uint32_t));
  // Whoever copies or writes JSON goes down into it: what is nested deeper than we do is left out.
  const auto is_shallow = [](int depth, nlohmann::json::parse_event_t, nlohmann::json&) {
    constexpr int kMaxDepth = 16;
    return depth <= kMaxDepth;
  };
  const nlohmann::json hello =
      nlohmann::json::parse(told->begin() + static_cast<ptrdiff_t>(start), told->end(), is_shallow, false);
  return hello.is_object() ? hello : nlohmann::json::object();
}

}  // namespace dynamic_slam
