#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace dynamic_slam {

// Files that come with the program, such as cameras and detectors: NAME.yaml in the folder of their kind
// ("cameras", "detectors") in the first of $DYNAMIC_SLAM_CONFIG, the config of the installation that the
// program or libdynamic_slam.so is in, and that of the source tree.

// The names of all files of the kind, sorted.
std::vector<std::string> ConfigNames(const std::string& kind);

// The file: name_or_path itself where there is such a file, else the one of that name. what: "camera". Throws
// InputError that lists the known names, other_names with them.
std::filesystem::path FindConfig(const std::string& kind, const std::string& what,
                                 const std::string& name_or_path,
                                 std::span<const std::string> other_names = {});

}  // namespace dynamic_slam
