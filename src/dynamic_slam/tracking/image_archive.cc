#include "dynamic_slam/tracking/image_archive.h"

#include <algorithm>
#include <cstring>

namespace dynamic_slam {
namespace {

constexpr size_t kMaxBytes = size_t{4} << 30;

// Calls visit(pixels, count) for the parts of the image that lie in a row of its own and in one chunk; visit
// returns how many it took.
template <class Visitor>
void ForEachRun(const cv::Mat& grey, Visitor&& visit) {
  for (int y = 0; y < grey.rows; ++y) {
    uint8_t* row = const_cast<uint8_t*>(grey.ptr<uint8_t>(y));
    for (size_t x = 0; x < static_cast<size_t>(grey.cols);)
      x += visit(row + x, static_cast<size_t>(grey.cols) - x);
  }
}

}  // namespace

void ImageArchive::Keep(double timestamp_s, const cv::Mat& grey) {
  if (chunks_.size() * sizeof(Chunk) > kMaxBytes) return;
  first_chunk_[timestamp_s] = chunks_.size();
  Chunk chunk{};
  size_t used = 0;
  ForEachRun(grey, [&](const uint8_t* pixels, size_t count) {
    const size_t taken = std::min(count, chunk.bytes.size() - used);
    std::memcpy(chunk.bytes.data() + used, pixels, taken);
    used += taken;
    if (used == chunk.bytes.size()) {
      chunks_.push_back(chunk);
      used = 0;
    }
    return taken;
  });
  if (used > 0) chunks_.push_back(chunk);
}

bool ImageArchive::Read(double timestamp_s, cv::Mat* grey) const {
  const auto found = first_chunk_.find(timestamp_s);
  if (found == first_chunk_.end()) return false;
  size_t chunk = found->second, used = 0;
  ForEachRun(*grey, [&](uint8_t* pixels, size_t count) {
    const size_t taken = std::min(count, sizeof(Chunk) - used);
    std::memcpy(pixels, chunks_[chunk].bytes.data() + used, taken);
    used += taken;
    if (used == sizeof(Chunk)) {
      ++chunk;
      used = 0;
    }
    return taken;
  });
  chunks_.Release(found->second, chunk + (used > 0 ? 1 : 0) - found->second);
  return true;
}

void ImageArchive::Clear() {
  first_chunk_.clear();
  chunks_.clear();
}

}  // namespace dynamic_slam
