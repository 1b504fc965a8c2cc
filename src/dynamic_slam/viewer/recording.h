#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "dynamic_slam/viewer/message.h"

namespace dynamic_slam {

// The messages of a run in a file, each with the stamp of its image; docs/viewer.md has the bytes.
inline constexpr char kRecordingName[] = "recording.view";

// Throws InputError when the file cannot be made, and by Add when the disk is full.
class RecordingWriter {
 public:
  explicit RecordingWriter(std::filesystem::path file);
  void Add(double timestamp_s, const Message& message);

 private:
  std::filesystem::path file_;
  std::ofstream stream_;
};

// A recording, of which only the index is in memory. What a run that was killed left half written at the end
// is ignored.
class RecordingReader {
 public:
  struct Entry {
    MessageHeader header;
    double timestamp_s;
    uint64_t offset;  // of the message in the file
    uint32_t bytes;
  };

  // Throws InputError when it is no recording, or has no frame.
  explicit RecordingReader(const std::filesystem::path& file);

  const std::vector<Entry>& entries() const { return entries_; }  // the first is kHello
  const std::vector<size_t>& frames() const { return frames_; }   // indices of kFrame

  Message Read(size_t entry);

  // What is run, as the first message tells it; an empty object when that is none.
  nlohmann::json Hello();

 private:
  std::string name_;
  std::ifstream stream_;
  std::vector<Entry> entries_;
  std::vector<size_t> frames_;
};

}  // namespace dynamic_slam
