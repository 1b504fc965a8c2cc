#include "dynamic_slam/base/config_files.h"

#include <algorithm>
#include <cstdlib>
#include <system_error>

#include <dlfcn.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

// The file of this code: the program, or libdynamic_slam.so in another one.
fs::path OwnFile() {
  Dl_info info{};
  std::error_code error;
  if (dladdr(reinterpret_cast<const void*>(&OwnFile), &info) != 0 && info.dli_fname != nullptr) {
    // A program is named as it was called there, which need not be a path.
    const fs::path file = info.dli_fname;
    if (file.is_absolute()) return fs::weakly_canonical(file, error);
  }
  return fs::read_symlink("/proc/self/exe", error);
}

// Best first.
std::vector<fs::path> Folders(const std::string& kind) {
  std::vector<fs::path> folders;
  if (const char* config = std::getenv("DYNAMIC_SLAM_CONFIG"); config != nullptr && *config != '\0') {
    folders.push_back(fs::path(config) / kind);
  }
  // Above bin, lib or lib/x86_64-linux-gnu.
  const fs::path own_folder = OwnFile().parent_path();
  for (const fs::path& prefix : {own_folder.parent_path(), own_folder.parent_path().parent_path()}) {
    folders.push_back(prefix / "share/dynamic_slam/config" / kind);
  }
  folders.push_back(fs::path(DYNAMIC_SLAM_SOURCE_CONFIG) / kind);
  return folders;
}

}  // namespace

std::vector<std::string> ConfigNames(const std::string& kind) {
  std::vector<std::string> names;
  for (const fs::path& folder : Folders(kind)) {
    std::error_code ignored;
    for (const auto& item : fs::directory_iterator(folder, ignored)) {
      if (item.path().extension() == ".yaml") names.push_back(item.path().stem().string());
    }
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

fs::path FindConfig(const std::string& kind, const std::string& what, const std::string& name_or_path,
                    std::span<const std::string> other_names) {
  const fs::path path(name_or_path);
  std::error_code ignored;
  if (fs::is_regular_file(path, ignored)) return path;
  const bool is_name = !path.has_parent_path() && path.extension() != ".yaml" && path.extension() != ".yml";
  if (is_name && !name_or_path.empty()) {
    for (const fs::path& folder : Folders(kind)) {
      const fs::path file = folder / (name_or_path + ".yaml");
      if (fs::is_regular_file(file, ignored)) return file;
    }
  }
  std::vector<std::string> known(other_names.begin(), other_names.end());
  for (const std::string& name : ConfigNames(kind)) known.push_back(name);
  throw InputError(
      fmt::format("{} '{}'", what, name_or_path),
      is_name ? "is neither a file nor a known name" : "there is no such file",
      fmt::format("Known names: {}.{}", fmt::join(known, ", "), DidYouMean(name_or_path, known)));
}

}  // namespace dynamic_slam
