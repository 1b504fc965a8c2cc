#include "mask_folder.h"

#include <vector>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/eval/canvas.h"
#include "dynamic_slam/semantics/selective_tracking.h"

namespace dynamic_slam {

std::filesystem::path MaskFolder::PathOf(const SourceImage& image) const {
  return folder_ / std::filesystem::path(image.name).filename().replace_extension(".png");
}

cv::Mat MaskFolder::Read(const SourceImage& image) const {
  const std::filesystem::path path = PathOf(image);
  if (!std::filesystem::exists(path)) return {};
  const cv::Mat mask = cv::imread(path.string(), cv::IMREAD_GRAYSCALE);
  if (mask.empty())
    throw InputError(path.string(), "is no image", "Replace it, or take it away: then nothing is masked.");
  if (mask.size() != size_) {
    throw InputError(path.string(),
                     fmt::format("is {}x{}, the image as tracking sees it {}x{}", mask.cols, mask.rows,
                                 size_.width, size_.height),
                     "Make the masks of the same size.");
  }
  return mask;
}

void MaskFolder::Write(const SourceImage& image, const FrameResult& result) const {
  std::vector<Box> boxes;
  for (const DynamicBox& object : result.objects.boxes) {
    if (object.is_dynamic) boxes.push_back(object.box);
  }
  WritePicture(PathOf(image).string(), DynamicMask(boxes, size_.width, size_.height));
}

}  // namespace dynamic_slam
