#include "dynamic_slam/base/file_backed_vector.h"

#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

namespace dynamic_slam {
namespace {

struct Element {
  double a;
  uint32_t b;
};

constexpr size_t kPerBlock = FileBackedBlocks::kBlockBytes / sizeof(Element);

Element Numbered(size_t i) { return {0.5 * static_cast<double>(i), static_cast<uint32_t>(i)}; }

FileBackedVector<Element> Filled(size_t size) {
  FileBackedVector<Element> vector;
  for (size_t i = 0; i < size; ++i) vector.push_back(Numbered(i));
  return vector;
}

void ExpectNumbered(const FileBackedVector<Element>& vector, size_t size) {
  ASSERT_EQ(vector.size(), size);
  size_t i = 0, wrong = 0;
  for (const Element& element : vector) {
    wrong += element.a != Numbered(i).a || element.b != i || &element != &vector[i];
    ++i;
  }
  EXPECT_EQ(i, size);
  EXPECT_EQ(wrong, 0u);
}

// What the process has of it in memory, kB.
size_t Resident(const void* address) {
  std::ifstream maps("/proc/self/smaps");
  bool is_here = false;
  for (std::string line; std::getline(maps, line);) {
    if (size_t dash = line.find('-'); dash != std::string::npos && dash < line.find(' ')) {
      const auto at = reinterpret_cast<uintptr_t>(address);
      is_here = std::stoull(line.substr(0, dash), nullptr, 16) <= at &&
                at < std::stoull(line.substr(dash + 1), nullptr, 16);
    } else if (is_here && line.starts_with("Rss:")) {
      return std::stoul(line.substr(4));
    }
  }
  return 0;
}

TEST(FileBackedVectorTest, HoldsWhatWasPutIn) {
  for (const size_t size : {size_t{0}, size_t{1}, kPerBlock, kPerBlock + 1, 5 * kPerBlock + 7}) {
    FileBackedVector<Element> vector = Filled(size);
    ExpectNumbered(vector, size);
    const FileBackedVector<Element> copy = vector;
    ExpectNumbered(copy, size);
    const FileBackedVector<Element> moved = std::move(vector);
    ExpectNumbered(moved, size);
    vector = copy;
    ExpectNumbered(vector, size);
    vector.push_back(Numbered(size));
    ExpectNumbered(vector, size + 1);
    ExpectNumbered(copy, size);
    vector.pop_back();
    ExpectNumbered(vector, size);
    vector.push_back(Numbered(size));
    ExpectNumbered(vector, size + 1);
    vector.clear();
    EXPECT_TRUE(vector.empty());
    vector.Assign(std::vector<Element>{Numbered(0), Numbered(1)});
    ExpectNumbered(vector, 2);
  }
}

TEST(FileBackedVectorTest, OnlyTheEndIsInMemory) {
  const FileBackedVector<Element> vector = Filled(4 * kPerBlock + 1);
  constexpr size_t kBlockKb = FileBackedBlocks::kBlockBytes / 1024;
  // Mappings that lie side by side are one in the system's list.
  EXPECT_LT(Resident(&vector[2 * kPerBlock]), kBlockKb);
  ExpectNumbered(vector, 4 * kPerBlock + 1);
  EXPECT_GE(Resident(&vector[2 * kPerBlock]), kBlockKb) << "until it is looked at";
  vector.Release(0, vector.size());
  EXPECT_EQ(Resident(&vector[2 * kPerBlock]), 0u);
  ExpectNumbered(vector, 4 * kPerBlock + 1);
  vector.Release(0, 0);
}

TEST(FileBackedBlocksTest, WithoutAFolderForTheFileAllStaysInMemory) {
  FileBackedBlocks blocks;
  for (int i = 0; i < 3; ++i) blocks.Add();
  EXPECT_EQ(blocks.FileCount(), 2u) << "a short run needs no file";
  blocks.Clear();
  const char* before = std::getenv("TMPDIR");
  const std::string old = before == nullptr ? "" : before;
  setenv("TMPDIR", "/proc/no_such_folder", 1);
  for (int i = 0; i < 3; ++i) blocks.Add();
  EXPECT_EQ(blocks.FileCount(), 0u);
  ExpectNumbered(Filled(3 * kPerBlock), 3 * kPerBlock);
  if (before == nullptr) {
    unsetenv("TMPDIR");
  } else {
    setenv("TMPDIR", old.c_str(), 1);
  }
}

}  // namespace
}  // namespace dynamic_slam
