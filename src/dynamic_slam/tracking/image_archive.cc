#include "dynamic_slam/tracking/image_archive.h"

#include <algorithm>
#include <cstring>

namespace dynamic_slam {
namespace {

constexpr size_t kMaxBytes = size_t{4} << 30, kMaxBytesInMemory = size_t{32} << 20;

}  // namespace

void ImageArchive::Keep(double timestamp_s, const cv::Mat& grey) {
  if (chunks_.size() * sizeof(Chunk) > kMaxBytes || chunks_.BytesInMemory() > kMaxBytesInMemory) return;
  first_chunk_[timestamp_s] = chunks_.size();
  Chunk chunk{};
  size_t used = 0;
  for (int y = 0; y < grey.rows; ++y) {
    const uint8_t* pixel = grey.ptr<uint8_t>(y);
    const uint8_t* const end = pixel + grey.cols;
    while (pixel < end) {
      const size_t count = std::min(static_cast<size_t>(end - pixel), sizeof(Chunk) - used);
      std::memcpy(chunk.bytes.data() + used, pixel, count);
      pixel += count;
      used = (used + count) % sizeof(Chunk);
      if (used == 0) chunks_.push_back(chunk);
    }
  }
  if (used > 0) chunks_.push_back(chunk);
}

bool ImageArchive::Read(double timestamp_s, cv::Mat* grey) const {
  const auto found = first_chunk_.find(timestamp_s);
  if (found == first_chunk_.end()) return false;
  size_t chunk = found->second, used = 0;
  for (int y = 0; y < grey->rows; ++y) {
    uint8_t* pixel = grey->ptr<uint8_t>(y);
    uint8_t* const end = pixel + grey->cols;
    while (pixel < end) {
      const size_t count = std::min(static_cast<size_t>(end - pixel), sizeof(Chunk) - used);
      std::memcpy(pixel, chunks_[chunk].bytes.data() + used, count);
      pixel += count;
      used = (used + count) % sizeof(Chunk);
      if (used == 0) ++chunk;
    }
  }
  if (used > 0) ++chunk;
  chunks_.Release(found->second, chunk - found->second);
  return true;
}

void ImageArchive::Clear() {
  first_chunk_.clear();
  chunks_.clear();
}

}  // namespace dynamic_slam
