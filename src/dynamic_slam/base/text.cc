#include "dynamic_slam/base/text.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>

#include <fcntl.h>
#include <unistd.h>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

constexpr std::string_view kSpace = " \t\r\n\v\f";

}  // namespace

int EditDistance(std::string_view a, std::string_view b) {
  // Three rows of the optimal string alignment table: the one before last, the last, the current.
  std::vector<int> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) last[j] = static_cast<int>(j);
  for (size_t i = 1; i <= a.size(); ++i) {
    row[0] = static_cast<int>(i);
    for (size_t j = 1; j <= b.size(); ++j) {
      const int replace = last[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, replace});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
    std::swap(before, last);
    std::swap(last, row);
  }
  return last[b.size()];
}

std::optional<std::string> ClosestName(std::string_view name, std::span<const std::string> candidates) {
  int best = std::max(2, static_cast<int>(name.size()) / 3) + 1;
  std::optional<std::string> closest;
  for (const std::string& candidate : candidates) {
    int distance = EditDistance(name, candidate);
    // A key without its section, as in min_inliers for tracker.min_inliers, is no misspelling at all.
    const size_t dot = candidate.rfind('.');
    if (dot != std::string::npos && name == std::string_view(candidate).substr(dot + 1)) distance = 0;
    // Nor is every short word a misspelling of another one.
    if (distance >= static_cast<int>(std::max(name.size(), candidate.size()))) continue;
    if (distance < best) {
      best = distance;
      closest = candidate;
    }
  }
  return closest;
}

std::string DidYouMean(std::string_view name, std::span<const std::string> candidates) {
  const std::optional<std::string> closest = ClosestName(name, candidates);
  return closest ? fmt::format(" Did you mean '{}'?", *closest) : "";
}

std::optional<double> ParseDouble(std::string_view text) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc::result_out_of_range) {
    // Too large or too small for a double: too small is 0 for every purpose here.
    return std::nullopt;
  }
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string ShortestDouble(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_not_of("-0123456789") == std::string::npos) text += ".0";
  return text;
}

std::string Quoted(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      quoted += fmt::format("\\u{:04x}", static_cast<unsigned char>(c));
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string_view Trim(std::string_view text) {
  const size_t begin = text.find_first_not_of(kSpace);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kSpace) - begin + 1);
}

std::vector<std::string_view> SplitColumns(std::string_view line, std::string_view more_separators) {
  const std::string separators = std::string(kSpace) + std::string(more_separators);
  std::vector<std::string_view> columns;
  size_t begin = line.find_first_not_of(separators);
  while (begin != std::string_view::npos) {
    const size_t end = std::min(line.find_first_of(separators, begin), line.size());
    columns.push_back(line.substr(begin, end - begin));
    begin = line.find_first_not_of(separators, end);
  }
  return columns;
}

std::vector<TextLine> ReadDataLines(const std::filesystem::path& file) {
  const std::string content = ReadFile(file);
  std::vector<TextLine> lines;
  int number = 0;
  for (size_t begin = 0; begin < content.size();) {
    const size_t end = std::min(content.find('\n', begin), content.size());
    const std::string_view line = Trim(std::string_view(content).substr(begin, end - begin));
    ++number;
    if (!line.empty() && line[0] != '#') lines.push_back({number, std::string(line)});
    begin = end + 1;
  }
  return lines;
}

std::string ReadFile(const std::filesystem::path& file, const std::string& remedy) {
  constexpr size_t kMaxUnannounced = 64 << 20;
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) {
    throw InputError(file.string(), "is a folder, a file is wanted", remedy);
  }
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    throw InputError(file.string(), fmt::format("cannot be read ({})", std::strerror(errno)), remedy);
  }
  std::string content;
  // At once, where the size is known.
  const uintmax_t announced = std::filesystem::file_size(file, ignored);
  const size_t block = ignored ? 1 << 16 : std::max<size_t>(announced + 1, 1 << 16);
  for (size_t size = 0; stream;) {
    if (ignored && size > kMaxUnannounced) {
      throw InputError(file.string(), fmt::format("does not end within {} bytes", kMaxUnannounced), remedy);
    }
    content.resize(size + block);
    stream.read(content.data() + size, static_cast<std::streamsize>(content.size() - size));
    size += static_cast<size_t>(stream.gcount());
    content.resize(size);
  }
  if (stream.bad()) throw InputError(file.string(), "reading failed", remedy);
  return content;
}

namespace {

bool WriteAll(int descriptor, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = write(descriptor, content.data(), content.size());
    if (written < 0 && errno != EINTR) return false;
    if (written > 0) content.remove_prefix(static_cast<size_t>(written));
  }
  return true;
}

// Writes FILE.tmp to the disk, and returns its path.
std::filesystem::path WriteTemporary(const std::filesystem::path& file, std::string_view content) {
  std::error_code error;
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), error);
  std::filesystem::path temporary = file;
  temporary += ".tmp";
  const int descriptor = open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  bool done = descriptor >= 0 && WriteAll(descriptor, content) && fsync(descriptor) == 0;
  int reason = errno;
  if (descriptor >= 0 && close(descriptor) != 0 && done) {
    done = false;
    reason = errno;
  }
  if (!done) {
    std::filesystem::remove(temporary, error);
    throw InputError(file.string(), fmt::format("cannot be written ({})", std::strerror(reason)),
                     "Choose a folder that can be written and has space left.");
  }
  return temporary;
}

// So that a rename outlives a power cut; where a folder cannot be synced, the system does it in its time.
void SyncFolder(const std::filesystem::path& folder) {
  const int descriptor = open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  fsync(descriptor);
  close(descriptor);
}

}  // namespace

void WriteFileAtomically(const std::filesystem::path& file, std::string_view content) {
  const std::filesystem::path temporary = WriteTemporary(file, content);
  std::error_code error;
  std::filesystem::rename(temporary, file, error);
  if (error) {
    const std::string reason = fmt::format("cannot be written ({})", error.message());
    std::filesystem::remove(temporary, error);
    throw InputError(file.string(), reason, "Choose another name.");
  }
  SyncFolder(file.parent_path());
}

void CheckCanBeWritten(const std::filesystem::path& file) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error)) {
    throw InputError(file.string(), "cannot be written (it is a folder)", "Choose another name.");
  }
  std::filesystem::remove(WriteTemporary(file, ""), error);
}

}  // namespace dynamic_slam
