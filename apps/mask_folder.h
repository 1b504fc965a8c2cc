#pragma once

#include <filesystem>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/system/slam_system.h"

namespace dynamic_slam {

// Masks of what moves (Eq. 11), one PNG for each image, of its name: 0 is static, all else is dynamic.
class MaskFolder {
 public:
  // size: of the images as tracking sees them, px.
  MaskFolder(std::filesystem::path folder, cv::Size size) : folder_(std::move(folder)), size_(size) {}

  // CV_8UC1, or empty where there is no file for the image: then nothing is masked. Throws InputError for one
  // that cannot be read or has another size.
  cv::Mat Read(const SourceImage& image) const;

  // The boxes of the frame's dynamic objects. Throws InputError when the file cannot be written.
  void Write(const SourceImage& image, const FrameResult& result) const;

  std::filesystem::path PathOf(const SourceImage& image) const;
  const std::filesystem::path& folder() const { return folder_; }

 private:
  std::filesystem::path folder_;
  cv::Size size_;
};

}  // namespace dynamic_slam
