#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/map/map.h"

namespace dynamic_slam {

// A map between runs, and the camera in whose ideal pixels its keypoints are. Its keyframes are of no frame
// of this run: Keyframe::frame_id is not valid, and Landmark::is_from_file says the same.
struct SavedMap {
  Camera camera;
  Map map;
};

// docs/map_file.md has the bytes.
inline constexpr uint32_t kMapFileVersion = 1;

// The bytes of a map file. Ids become dense. Landmarks that are more likely to move than to be at rest are
// left out.
std::string EncodeMap(const Camera& camera, const Map& map);

// The map of such bytes. Whatever they are, it is valid (Map::Validate), and takes no more memory than a
// fixed multiple of their number. Throws InputError that begins with `name` for bytes that are damaged, of
// another version, or no map.
SavedMap DecodeMap(std::string_view bytes, const std::string& name);

// The bytes of a map file with what it says after the header: for tests of what a right checksum protects.
std::string WithMapHeader(std::string_view payload);

// Writes FILE.tmp and renames it. Throws InputError.
void WriteMapFile(const std::filesystem::path& file, const Camera& camera, const Map& map);

// Throws InputError.
SavedMap ReadMapFile(const std::filesystem::path& file);

// Throws InputError, which begins with `name`, when the map was made with another camera or other octaves
// than these (OctaveScales).
void CheckMapFits(const SavedMap& saved, const Camera& camera, const std::vector<float>& octave_scales,
                  const std::string& name);

}  // namespace dynamic_slam
