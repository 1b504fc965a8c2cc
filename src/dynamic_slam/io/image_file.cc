#include "dynamic_slam/io/image_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <string_view>

#include <opencv2/imgcodecs.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/base/trace.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

// The `count` bytes at `at` as a number.
uint64_t BigEndian(std::string_view bytes, size_t at, size_t count) {
  uint64_t value = 0;
  for (size_t i = 0; i < count; ++i) value = value << 8 | static_cast<uint8_t>(bytes[at + i]);
  return value;
}

uint64_t LittleEndian(std::string_view bytes, size_t at, size_t count) {
  uint64_t value = 0;
  for (size_t i = count; i > 0; --i) value = value << 8 | static_cast<uint8_t>(bytes[at + i - 1]);
  return value;
}

// A PNG is a signature and chunks of (length, name, data, checksum), of which IEND is the last.
bool IsTruncatedPng(std::string_view bytes) {
  size_t at = 8;
  while (at + 12 <= bytes.size()) {
    if (bytes.substr(at + 4, 4) == "IEND") return false;
    at += 12 + BigEndian(bytes, at, 4);
  }
  return true;
}

// The last start of scan (FF DA) must have an end of image (FF D9) after it. Neither pair occurs in
// entropy-coded data.
bool IsTruncatedJpeg(std::string_view bytes) {
  const size_t scan = bytes.rfind("\xFF\xDA"), end = bytes.rfind("\xFF\xD9");
  return scan == std::string::npos || end == std::string::npos || end < scan;
}

// Binary PGM and PPM: P5 or P6, width, height and largest value as words between comments, one white space,
// pixels. Only the first image counts.
bool IsTruncatedPnm(std::string_view bytes) {
  std::array<uint64_t, 3> numbers{};
  size_t at = 2;
  for (uint64_t& number : numbers) {
    while (at < bytes.size() &&
           (std::isspace(static_cast<unsigned char>(bytes[at])) != 0 || bytes[at] == '#')) {
      at = bytes[at] == '#' ? std::min(bytes.find('\n', at), bytes.size()) : at + 1;
    }
    for (; at < bytes.size() && std::isdigit(static_cast<unsigned char>(bytes[at])) != 0; ++at) {
      number = std::min<uint64_t>(10 * number + static_cast<uint64_t>(bytes[at] - '0'), 1'000'000);
    }
  }
  const uint64_t channels = bytes[1] == '6' ? 3 : 1, depth = numbers[2] > 255 ? 2 : 1;
  return at + 1 + numbers[0] * numbers[1] * channels * depth > bytes.size();
}

}  // namespace

bool IsTruncatedImage(const std::string& bytes) {
  const std::string_view view = bytes;
  if (view.starts_with("\x89PNG\r\n\x1A\n")) return IsTruncatedPng(view);
  if (view.starts_with("\xFF\xD8\xFF")) return IsTruncatedJpeg(view);
  if (view.starts_with("P5") || view.starts_with("P6")) return IsTruncatedPnm(view);
  if (view.starts_with("RIFF") && view.size() >= 12 && view.substr(8, 4) == "WEBP") {
    return 8 + LittleEndian(view, 4, 4) > view.size();
  }
  if (view.starts_with("BM") && view.size() >= 6) return LittleEndian(view, 2, 4) > view.size();
  return false;
}

cv::Mat DecodeImage(const std::string& bytes, std::string* reason) {
  DS_TRACE("io/decode");
  if (bytes.empty()) return *reason = "the file is empty", cv::Mat();
  if (IsTruncatedImage(bytes)) return *reason = "the image is truncated", cv::Mat();
  cv::Mat image;
  try {
    image = cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data())),
                         cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    image.release();
  }
  if (image.empty()) *reason = "the image cannot be decoded";
  return image;
}

cv::Mat ReadImage(const fs::path& file, std::string* reason) {
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return *reason = "the file is missing", cv::Mat();
  std::string bytes;
  try {
    bytes = ReadFile(file);
  } catch (const InputError&) {
    return *reason = "the file cannot be read", cv::Mat();
  }
  return DecodeImage(bytes, reason);
}

bool HasImageExtension(const fs::path& file) {
  static constexpr std::array<std::string_view, 10> kExtensions = {".png",  ".jpg", ".jpeg", ".bmp",  ".tif",
                                                                   ".tiff", ".pgm", ".ppm",  ".webp", ".jp2"};
  std::string extension = file.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

}  // namespace dynamic_slam
