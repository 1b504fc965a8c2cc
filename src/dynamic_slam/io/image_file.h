#pragma once

#include <filesystem>
#include <string>

#include <opencv2/core/mat.hpp>

namespace dynamic_slam {

// Decodes an image as it is stored: its channels (grey, BGR or BGRA) and depth; no EXIF rotation. Returns an
// empty image, and in *reason why, when the file is missing, truncated or no image.
cv::Mat ReadImage(const std::filesystem::path& file, std::string* reason);

// The same of the bytes of such a file.
cv::Mat DecodeImage(const std::string& bytes, std::string* reason);

// Whether the end of an encoded PNG, JPEG, BMP, WebP or binary PGM/PPM is missing. Decoders fill up what is
// missing, with no more than a warning on standard error, and call it a success.
bool IsTruncatedImage(const std::string& bytes);

// By its extension.
bool HasImageExtension(const std::filesystem::path& file);

}  // namespace dynamic_slam
