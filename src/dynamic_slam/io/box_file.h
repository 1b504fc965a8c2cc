#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "dynamic_slam/semantics/detection.h"

namespace dynamic_slam {

// A row of a box file: an object in the image of a time.
struct BoxRecord {
  double timestamp_s = 0;
  std::string class_name = "person";
  double score = 1;    // 0 to 1
  double visible = 1;  // truth: the share of its silhouette that the box shows, 0 to 1
  Box box;             // px of the camera's image, before it is cropped or resized
};

// Comma-separated values with a header that names the columns, in any order: timestamp (s), x, y (top left
// corner), w, h (px), and, where the file has them, class, score and visible; others are skipped. A file
// without classes is about persons. Detections are `timestamp,class,score,x,y,w,h`, truth is
// `timestamp,actor,x,y,w,h,visible`. Rows may be in any order; a file without rows has no boxes. Throws
// InputError with file:line.
std::vector<BoxRecord> ReadBoxFile(const std::filesystem::path& file);

// Writes `timestamp,class,score,x,y,w,h`. Throws InputError.
void WriteBoxFile(const std::filesystem::path& file, std::span<const BoxRecord> records);

}  // namespace dynamic_slam
