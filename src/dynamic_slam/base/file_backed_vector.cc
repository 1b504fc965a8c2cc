#include "dynamic_slam/base/file_backed_vector.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace dynamic_slam {
namespace {

// Gone from its folder at once, so that nothing is left of it when the program is killed.
int OpenUnnamed() {
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::temp_directory_path(error);
  if (error) return -1;
  std::string name = (folder / "dynamic_slam_XXXXXX").string();
  const int file = mkostemp(name.data(), O_CLOEXEC);
  if (file >= 0) unlink(name.c_str());
  return file;
}

std::byte* Map(int flags, int file, off_t at) {
  void* memory = mmap(nullptr, FileBackedBlocks::kBlockBytes, PROT_READ | PROT_WRITE, flags, file, at);
  return memory == MAP_FAILED ? nullptr : static_cast<std::byte*>(memory);
}

}  // namespace

void FileBackedBlocks::Add() {
  blocks_.reserve(blocks_.size() + 1);
  std::byte* memory = blocks_.empty() ? nullptr : MapFromFile();  // a short run needs no file
  const bool is_in_file = memory != nullptr;
  if (!is_in_file) memory = Map(MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == nullptr) throw std::bad_alloc();
  if (!blocks_.empty()) Release(blocks_.size() - 1);
  blocks_.push_back({memory, is_in_file});
}

void FileBackedBlocks::Release(size_t block) const {
  if (blocks_[block].is_in_file) madvise(blocks_[block].memory, kBlockBytes, MADV_DONTNEED);
}

std::byte* FileBackedBlocks::MapFromFile() {
  if (file_ == kNone) {
    file_ = OpenUnnamed();
    if (file_ < 0) file_ = kImpossible;
  }
  if (file_ == kImpossible) return nullptr;
  const auto at = static_cast<off_t>(FileCount() * kBlockBytes);
  // The room is taken now: writing to a mapped page that the disk has no room for ends the program.
  if (posix_fallocate(file_, at, static_cast<off_t>(kBlockBytes)) != 0) return nullptr;
  return Map(MAP_SHARED, file_, at);
}

void FileBackedBlocks::Clear() {
  for (const Block& block : blocks_) munmap(block.memory, kBlockBytes);
  blocks_.clear();
  if (file_ >= 0) close(file_);
  file_ = kNone;
}

size_t FileBackedBlocks::FileCount() const {
  return static_cast<size_t>(
      std::count_if(blocks_.begin(), blocks_.end(), [](const Block& block) { return block.is_in_file; }));
}

}  // namespace dynamic_slam
