#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string_view>

namespace dynamic_slam {

// One of the program's readers, under whatever bytes somebody gives it. `read` throws InternalError when a
// promise is broken; that what is refused is refused well is part of it. folder: its own to write to.
struct Reader {
  const char* name;  // as its folder in fuzz/corpora
  void (*read)(std::string_view bytes, const std::filesystem::path& folder);
};

std::span<const Reader> Readers();

// Of other files.
void ReadViewerRecording(std::string_view bytes, const std::filesystem::path& folder);
void ReadViewerRequest(std::string_view bytes, const std::filesystem::path& folder);
void ReadViewerCommand(std::string_view bytes, const std::filesystem::path& folder);
void ReadMapBytes(std::string_view bytes, const std::filesystem::path& folder);
void ReadRunJournal(std::string_view bytes, const std::filesystem::path& folder);
void ReadTumSequence(std::string_view bytes, const std::filesystem::path& folder);
void ReadKittiSequence(std::string_view bytes, const std::filesystem::path& folder);
void ReadEurocSequence(std::string_view bytes, const std::filesystem::path& folder);

// Writes the file, quicker and less safely than the program does, and returns its path.
std::filesystem::path Put(const std::filesystem::path& file, std::string_view bytes);

// Whether `call` took its input. An InputError is a refusal, and must begin with `name`.
bool IsTaken(std::string_view name, const std::function<void()>& call);

}  // namespace dynamic_slam
