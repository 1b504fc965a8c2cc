#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace dynamic_slam {

// What the server tells browsers, and what a recording holds; docs/viewer.md has the bytes.
enum class MessageType : uint32_t {
  kHello = 1,   // JSON: what is run
  kFrame = 2,   // JSON, keypoints, JPEG; detail: the tracking state
  kMap = 3,     // what changed in the map; detail: 1 when it is the whole map
  kEvent = 4,   // JSON: a line for the list of events
  kPlayer = 5,  // JSON: whether it is paused, and where a replay is
};

struct MessageHeader {
  MessageType type = MessageType::kHello;
  uint32_t frame = 0;  // counted from 0, of all images of the run
  uint32_t detail = 0;
};

using Message = std::shared_ptr<const std::string>;

static_assert(std::endian::native == std::endian::little, "messages are little-endian, as browsers are");

// Appends values to a message; every part begins at a multiple of four bytes, as typed arrays need.
class MessageWriter {
 public:
  explicit MessageWriter(const MessageHeader& header) {
    Add(static_cast<uint32_t>(header.type));
    Add(header.frame);
    Add(header.detail);
  }

  template <class T>
  void Add(const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % 4 == 0);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }

  // Its length in bytes, then the bytes, filled up with spaces.
  void AddBytes(std::string_view text) {
    Add(static_cast<uint32_t>(text.size()));
    bytes_ += text;
    bytes_.resize((bytes_.size() + 3) / 4 * 4, ' ');
  }

  // Text that is not UTF-8, as in a file of class names, is shown with marks and does no harm.
  void AddJson(const nlohmann::json& json) {
    AddBytes(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  }

  Message Finish() { return std::make_shared<const std::string>(std::move(bytes_)); }

 private:
  std::string bytes_;
};

inline constexpr size_t kMessageHeaderBytes = 12;

// The message must be as long as a header.
inline MessageHeader HeaderOf(std::string_view message) {
  uint32_t words[3];
  std::memcpy(words, message.data(), sizeof(words));
  return {static_cast<MessageType>(words[0]), words[1], words[2]};
}

inline Message JsonMessage(MessageType type, uint32_t frame, const nlohmann::json& json) {
  MessageWriter writer({type, frame, 0});
  writer.AddJson(json);
  return writer.Finish();
}

}  // namespace dynamic_slam
