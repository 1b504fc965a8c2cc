#include "dynamic_slam/io/point_cloud_file.h"

#include <bit>
#include <cstring>
#include <iterator>
#include <string>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {

void WritePly(const std::filesystem::path& file, std::span<const Eigen::Vector3f> points,
              std::span<const std::array<uint8_t, 3>> colours_rgb, PlyFormat format) {
  static_assert(std::endian::native == std::endian::little, "the binary form copies floats as they are");
  DS_CHECK(colours_rgb.empty() || colours_rgb.size() == points.size(), "colours={} points={}",
           colours_rgb.size(), points.size());
  std::string text = fmt::format(
      "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n",
      format == PlyFormat::kAscii ? "ascii" : "binary_little_endian", points.size());
  if (!colours_rgb.empty()) text += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  text += "end_header\n";
  for (size_t i = 0; i < points.size(); ++i) {
    if (format == PlyFormat::kBinary) {
      char bytes[3 * sizeof(float)];
      std::memcpy(bytes, points[i].data(), sizeof(bytes));
      text.append(bytes, sizeof(bytes));
      if (!colours_rgb.empty()) text.append(colours_rgb[i].begin(), colours_rgb[i].end());
      continue;
    }
    fmt::format_to(std::back_inserter(text), "{} {} {}", points[i].x(), points[i].y(), points[i].z());
    if (!colours_rgb.empty()) {
      fmt::format_to(std::back_inserter(text), " {} {} {}", colours_rgb[i][0], colours_rgb[i][1],
                     colours_rgb[i][2]);
    }
    text += '\n';
  }
  WriteFileAtomically(file, text);
}

}  // namespace dynamic_slam
