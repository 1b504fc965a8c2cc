#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/semantics/detector_file.h"

namespace dynamic_slam {

// SHA-256 of a file's bytes, in hexadecimal. Throws InputError when it cannot be read.
std::string Sha256(const std::filesystem::path& file);

// Where the files of networks are looked for, beside the detector file itself: models_folder unless it is
// empty, $DYNAMIC_SLAM_MODELS, and dynamic_slam/models in the user's data folder ($XDG_DATA_HOME or
// ~/.local/share).
std::vector<std::filesystem::path> ModelFolders(const std::filesystem::path& models_folder = {});

// One of the files that a detector file names.
struct NetworkFile {
  std::string role;  // "model", "config" or "anchors", as in the detector file
  NetworkFileOptions wanted;
  std::optional<std::filesystem::path> found{};  // nothing: it is in none of the folders

  // What it hashes to where that is known and another one is wanted, else "". It must be found.
  std::string WrongSha256() const;
};

// The files that a detector needs, and where they are: beside the detector file, else in the first of the
// folders that holds them.
std::vector<NetworkFile> FindNetworkFiles(const DetectorFile& detector,
                                          const std::vector<std::filesystem::path>& folders);

// The path of the file with that role, "" where the detector names none. Throws InputError that says where it
// was looked for and where to get it.
std::filesystem::path RequireNetworkFile(const DetectorFile& detector, const std::string& role,
                                         const std::vector<std::filesystem::path>& folders);

}  // namespace dynamic_slam
