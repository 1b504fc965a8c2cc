#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/base/file_backed_vector.h"

namespace dynamic_slam {

// The images of a run, in a file without a name in the folder for temporary files.
class ImageArchive {
 public:
  // grey: CV_8UC1, of one size. Of more than 4 GiB, or 32 MiB that no file holds, the later ones are left
  // out.
  void Keep(double timestamp_s, const cv::Mat& grey);
  bool Contains(double timestamp_s) const { return first_chunk_.contains(timestamp_s); }
  // False if there is none. *grey: of that size and type, with its memory.
  bool Read(double timestamp_s, cv::Mat* grey) const;
  void Clear();

 private:
  struct Chunk {
    std::array<uint8_t, 4096> bytes;
  };
  std::map<double, size_t> first_chunk_;
  FileBackedVector<Chunk> chunks_;
};

}  // namespace dynamic_slam
