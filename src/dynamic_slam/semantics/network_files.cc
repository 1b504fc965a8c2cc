#include "dynamic_slam/semantics/network_files.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <memory>

#include <openssl/evp.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

std::string Environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

// The folders in which this detector's files may be, best first.
std::vector<fs::path> FoldersOf(const DetectorFile& detector, const std::vector<fs::path>& folders) {
  std::vector<fs::path> all = {detector.file.parent_path()};
  all.insert(all.end(), folders.begin(), folders.end());
  return all;
}

}  // namespace

std::string Sha256(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
  DS_CHECK(context != nullptr && EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr) == 1);
  std::array<char, 1 << 16> buffer;
  while (stream.read(buffer.data(), buffer.size()), stream.gcount() > 0) {
    EVP_DigestUpdate(context.get(), buffer.data(), static_cast<size_t>(stream.gcount()));
  }
  if (!stream.eof()) throw InputError(file.string(), "cannot be read", "Check the path and its permissions.");
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest;
  unsigned size = 0;
  EVP_DigestFinal_ex(context.get(), digest.data(), &size);
  std::string text;
  for (unsigned i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
  return text;
}

std::vector<fs::path> ModelFolders(const fs::path& models_folder) {
  std::vector<fs::path> folders;
  if (!models_folder.empty()) folders.push_back(models_folder);
  if (const std::string models = Environment("DYNAMIC_SLAM_MODELS"); !models.empty())
    folders.emplace_back(models);
  if (const std::string data = Environment("XDG_DATA_HOME"); !data.empty()) {
    folders.push_back(fs::path(data) / "dynamic_slam/models");
  } else if (const std::string home = Environment("HOME"); !home.empty()) {
    folders.push_back(fs::path(home) / ".local/share/dynamic_slam/models");
  }
  return folders;
}

std::string NetworkFile::WrongSha256() const {
  DS_CHECK(found.has_value(), "{}", wanted.file);
  if (wanted.sha256.empty()) return "";
  const std::string is = Sha256(*found);
  return is == wanted.sha256 ? "" : is;
}

std::vector<NetworkFile> FindNetworkFiles(const DetectorFile& detector,
                                          const std::vector<fs::path>& folders) {
  const DetectorOptions& options = detector.options;
  std::vector<NetworkFile> files = {
      {"model", options.model}, {"config", options.config}, {"anchors", options.anchors}};
  std::erase_if(files, [](const NetworkFile& file) { return file.wanted.file.empty(); });
  for (NetworkFile& file : files) {
    for (const fs::path& folder : FoldersOf(detector, folders)) {
      std::error_code ignored;
      if (!fs::is_regular_file(folder / file.wanted.file, ignored)) continue;
      file.found = folder / file.wanted.file;
      break;
    }
  }
  return files;
}

fs::path RequireNetworkFile(const DetectorFile& detector, const std::string& role,
                            const std::vector<fs::path>& folders) {
  for (const NetworkFile& file : FindNetworkFiles(detector, folders)) {
    if (file.role != role) continue;
    if (file.found) return *file.found;
    std::vector<std::string> looked_in;
    for (const fs::path& folder : FoldersOf(detector, folders)) looked_in.push_back(folder.string());
    throw InputError(
        file.wanted.file,
        fmt::format("the {} of detector '{}' is in none of {}", role, detector.name,
                    fmt::join(looked_in, ", ")),
        fmt::format(
            "{}Name its folder with --models DIR, or put it into one of these.",
            detector.options.origin.empty() ? "" : fmt::format("Get it from {}. ", detector.options.origin)));
  }
  return {};
}

}  // namespace dynamic_slam
