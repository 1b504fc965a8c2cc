#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>

#include <Eigen/Core>

namespace dynamic_slam {

enum class PlyFormat { kAscii, kBinary };

// Writes a PLY point cloud (binary is little-endian), as FILE.tmp and then renamed. colours_rgb is empty or
// has one entry per point. Throws InputError when the file cannot be written.
void WritePly(const std::filesystem::path& file, std::span<const Eigen::Vector3f> points,
              std::span<const std::array<uint8_t, 3>> colours_rgb = {},
              PlyFormat format = PlyFormat::kBinary);

}  // namespace dynamic_slam
