#pragma once

#include <cstddef>
#include <iterator>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

namespace dynamic_slam {

// Blocks of memory whose contents lie in an unnamed file of the system's folder for temporary files, but for
// the first block. Where no file can be made or the disk is full, blocks stay in memory.
class FileBackedBlocks {
 public:
  static constexpr size_t kBlockBytes = size_t{1} << 18;  // a multiple of any page's size

  FileBackedBlocks() = default;
  ~FileBackedBlocks() { Clear(); }
  FileBackedBlocks(FileBackedBlocks&& other) noexcept { *this = std::move(other); }
  FileBackedBlocks& operator=(FileBackedBlocks&& other) noexcept {
    std::swap(blocks_, other.blocks_);
    std::swap(file_, other.file_);
    return *this;
  }

  // The block that was the last takes no memory any more, until it is looked at. Throws std::bad_alloc.
  void Add();
  // Nor does this one, where the file has it.
  void Release(size_t block) const;
  void Clear();

  size_t size() const { return blocks_.size(); }
  size_t FileCount() const;  // blocks that lie in the file
  std::byte* operator[](size_t block) const { return blocks_[block].memory; }

 private:
  struct Block {
    std::byte* memory;
    bool is_in_file;
  };

  std::byte* MapFromFile();  // null when there is no file, or no room in it

  std::vector<Block> blocks_;
  int file_ = kNone;
  static constexpr int kNone = -1, kImpossible = -2;
};

// A vector that grows by an element for each frame of a run that may last for days: memory holds its end
// only. Elements keep their addresses.
template <class T>
class FileBackedVector {
  static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= alignof(std::max_align_t));

 public:
  class Iterator {
   public:
    using iterator_category = std::forward_iterator_tag;
    using value_type = T;
    using difference_type = std::ptrdiff_t;
    using pointer = const T*;
    using reference = const T&;

    Iterator() = default;
    Iterator(const FileBackedVector* vector, size_t index) : vector_(vector), index_(index) {}
    const T& operator*() const { return (*vector_)[index_]; }
    Iterator& operator++() {
      ++index_;
      return *this;
    }
    Iterator operator++(int) {
      const Iterator before = *this;
      ++index_;
      return before;
    }
    bool operator==(const Iterator& other) const { return index_ == other.index_; }

   private:
    const FileBackedVector* vector_ = nullptr;
    size_t index_ = 0;
  };

  FileBackedVector() = default;
  FileBackedVector(const FileBackedVector& other) { Append(other); }
  FileBackedVector(FileBackedVector&& other) noexcept
      : blocks_(std::move(other.blocks_)), size_(std::exchange(other.size_, 0)) {}
  FileBackedVector& operator=(FileBackedVector other) noexcept {
    std::swap(blocks_, other.blocks_);
    std::swap(size_, other.size_);
    return *this;
  }

  void push_back(const T& value) {
    if (size_ == blocks_.size() * kPerBlock) blocks_.Add();
    new (Address(size_)) T(value);
    ++size_;
  }
  void pop_back() { --size_; }
  void clear() {
    blocks_.Clear();
    size_ = 0;
  }
  // These `count` elements, and those beside them, take no memory any more, until they are looked at again.
  void Release(size_t first, size_t count) const {
    if (count == 0) return;
    for (size_t block = first / kPerBlock; block <= (first + count - 1) / kPerBlock; ++block)
      blocks_.Release(block);
  }
  template <class Range>
  void Assign(const Range& values) {
    clear();
    Append(values);
  }

  // Of the blocks that no file holds.
  size_t BytesInMemory() const {
    return (blocks_.size() - blocks_.FileCount()) * FileBackedBlocks::kBlockBytes;
  }
  size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  const T& operator[](size_t index) const {
    return *std::launder(reinterpret_cast<const T*>(Address(index)));
  }
  const T& front() const { return (*this)[0]; }
  const T& back() const { return (*this)[size_ - 1]; }
  Iterator begin() const { return {this, 0}; }
  Iterator end() const { return {this, size_}; }

 private:
  static constexpr size_t kPerBlock = FileBackedBlocks::kBlockBytes / sizeof(T);

  template <class Range>
  void Append(const Range& values) {
    for (const T& value : values) push_back(value);
  }
  std::byte* Address(size_t index) const {
    return blocks_[index / kPerBlock] + index % kPerBlock * sizeof(T);
  }

  FileBackedBlocks blocks_;
  size_t size_ = 0;
};

}  // namespace dynamic_slam
