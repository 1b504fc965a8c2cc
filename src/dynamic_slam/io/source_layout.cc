#include "dynamic_slam/io/source_layout.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/image_file.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

// The images of a folder in natural order; empty when there is no such folder.
std::vector<fs::path> ListImages(const fs::path& folder) {
  std::vector<fs::path> images;
  std::error_code ignored;
  for (const auto& item : fs::directory_iterator(folder, ignored)) {
    const std::string name = item.path().filename().string();
    if (HasImageExtension(item.path()) && !name.starts_with('.') && !item.is_directory())
      images.push_back(item.path());
  }
  std::sort(images.begin(), images.end(), [](const fs::path& a, const fs::path& b) {
    return NaturalLess(a.filename().string(), b.filename().string());
  });
  return images;
}

SourceEntry Broken(const fs::path& file, const TextLine& line, const std::string& problem) {
  return {0, {}, fmt::format("{}:{}", file.filename().string(), line.number), problem};
}

// rgb.txt: "timestamp file", s.
SourceListing ListTum(const fs::path& folder) {
  const fs::path index = folder / "rgb.txt";
  SourceListing listing{"tum", folder, {}, {}};
  for (const TextLine& line : ReadDataLines(index)) {
    const size_t gap = std::min(line.text.find_first_of(" \t,"), line.text.size());
    const std::optional<double> stamp = ParseDouble(line.text.substr(0, gap));
    // The rest of the line is the file: a name may hold spaces.
    const std::string name(Trim(std::string_view(line.text).substr(std::min(gap + 1, line.text.size()))));
    if (!stamp || !std::isfinite(*stamp) || name.empty()) {
      listing.entries.push_back(Broken(index, line, fmt::format("'{}' is not 'timestamp file'", line.text)));
    } else {
      listing.entries.push_back({*stamp, folder / name, name, ""});
    }
  }
  if (listing.entries.empty()) {
    throw InputError(index.string(), "lists no image", "A line is: timestamp rgb/file.png");
  }
  return listing;
}

// image_0/000000.png, ... with the stamps in times.txt, s.
SourceListing ListKitti(const fs::path& folder) {
  const fs::path index = folder / "times.txt";
  if (!fs::is_regular_file(index)) {
    throw InputError(
        index.string(), "is missing",
        "A KITTI sequence has it beside image_0; or give the image_0 folder itself with --fps and --camera.");
  }
  SourceListing listing{"kitti", folder, folder / "calib.txt", {}};
  const std::vector<fs::path> images = ListImages(folder / "image_0");
  if (images.empty()) {
    throw InputError((folder / "image_0").string(), "holds no image",
                     "Put 000000.png, 000001.png, ... there.");
  }
  const std::vector<TextLine> lines = ReadDataLines(index);
  if (lines.empty())
    throw InputError(index.string(), "holds no stamp", "It has one stamp a line, in seconds.");
  // The number in a file's name is its line in times.txt.
  const std::string extension = images.front().extension().string();
  size_t count = 0;
  for (const fs::path& image : images) {
    const std::string stem = image.stem().string();
    size_t number = 0;
    const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), number);
    if (error != std::errc() || end != stem.data() + stem.size() || number >= 10'000'000) {
      listing.entries.push_back({0, image, image.filename().string(), "its name is not a number"});
    } else {
      count = std::max(count, number + 1);
    }
  }
  const size_t digits = images.front().stem().string().size();
  for (size_t i = 0; i < std::min(count, lines.size()); ++i) {
    const std::string name = fmt::format("{:0{}}{}", i, digits, extension);
    const std::optional<double> stamp = ParseDouble(lines[i].text);
    const bool is_stamp = stamp && std::isfinite(*stamp);
    listing.entries.push_back({stamp.value_or(0), folder / "image_0" / name, name,
                               is_stamp ? "" : fmt::format("times.txt:{}: no stamp", lines[i].number)});
  }
  if (count != lines.size()) {
    listing.entries.push_back({0,
                               {},
                               "times.txt",
                               fmt::format("has {} stamps for {} images; only the first {} are used",
                                           lines.size(), count, std::min(count, lines.size()))});
  }
  return listing;
}

// data.csv: "timestamp [ns],file", images in data/.
SourceListing ListEuroc(const fs::path& folder, const fs::path& cam0) {
  const fs::path index = cam0 / "data.csv";
  SourceListing listing{"euroc", folder, cam0 / "sensor.yaml", {}};
  for (const TextLine& line : ReadDataLines(index)) {
    const std::vector<std::string_view> columns = SplitColumns(line.text, ",");
    const std::string_view stamp =
        columns.empty() ? std::string_view() : columns[0];  // there may be only commas
    int64_t stamp_ns = 0;
    const char* last = stamp.data() + stamp.size();
    const auto [end, error] = std::from_chars(stamp.data(), last, stamp_ns);
    if (columns.size() != 2 || error != std::errc() || end != last) {
      listing.entries.push_back(
          Broken(index, line, fmt::format("'{}' is not 'nanoseconds,file'", line.text)));
    } else {
      const std::string name(columns[1]);
      listing.entries.push_back({static_cast<double>(stamp_ns) * 1e-9, cam0 / "data" / name, name, ""});
    }
  }
  if (listing.entries.empty()) {
    throw InputError(index.string(), "lists no image", "A line is: nanoseconds,file.png");
  }
  return listing;
}

SourceListing ListImageFolder(const fs::path& folder, const std::vector<fs::path>& images, double fps) {
  SourceListing listing{"images", folder, {}, {}};
  for (size_t i = 0; i < images.size(); ++i) {
    listing.entries.push_back({static_cast<double>(i) / fps, images[i], images[i].filename().string(), ""});
  }
  return listing;
}

// One stamp far ahead must not make all later ones go back: it is the stamp that is wrong when most of the
// next few lie before it and behind the last good one.
void MarkStampsAhead(std::vector<SourceEntry>* entries) {
  constexpr size_t kNext = 5, kMost = 3;
  std::vector<SourceEntry*> good;
  for (SourceEntry& entry : *entries) {
    if (entry.problem.empty()) good.push_back(&entry);
  }
  double last_s = -std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < good.size(); ++i) {
    const double stamp_s = good[i]->timestamp_s;
    size_t between = 0;
    for (size_t j = i + 1; j < std::min(good.size(), i + 1 + kNext); ++j) {
      if (good[j]->timestamp_s > last_s && good[j]->timestamp_s < stamp_s) ++between;
    }
    if (between >= kMost) {
      good[i]->problem = fmt::format("its stamp {:.6f} is ahead of those that follow", stamp_s);
    } else {
      last_s = std::max(last_s, stamp_s);
    }
  }
}

SourceListing ListAnySource(const fs::path& folder, double fps) {
  if (fs::is_regular_file(folder / "rgb.txt")) return ListTum(folder);
  for (const char* cam0 : {"mav0/cam0", "cam0", "."}) {
    const fs::path path = (folder / cam0).lexically_normal();
    if (fs::is_regular_file(path / "data.csv") && fs::is_directory(path / "data"))
      return ListEuroc(folder, path);
  }
  if (fs::is_directory(folder / "image_0")) return ListKitti(folder);
  const std::vector<fs::path> images = ListImages(folder);
  if (!images.empty()) return ListImageFolder(folder, images, fps);

  std::string remedy =
      "Known are: TUM RGB-D (rgb.txt), KITTI odometry (image_0 and times.txt), EuRoC (mav0/cam0/data.csv), a "
      "folder "
      "of images, a video file.";
  if (fs::is_directory(folder / "sequences")) {
    remedy = "This is the data set's folder: give one sequence of it, such as sequences/00.";
  } else if (fs::is_directory(folder / "rgb")) {
    remedy = "rgb.txt is missing: copy it here, or give the folder rgb itself with --fps.";
  }
  throw InputError(folder.string(), "the folder holds no image and no known layout", remedy);
}

}  // namespace

SourceListing ListSource(const fs::path& folder, double fps) {
  SourceListing listing = ListAnySource(folder, fps);
  MarkStampsAhead(&listing.entries);
  return listing;
}

bool NaturalLess(std::string_view a, std::string_view b) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (is_digit(a[i]) && is_digit(b[j])) {
      const auto run = [&is_digit](std::string_view text, size_t* at) {
        while (*at < text.size() && text[*at] == '0') ++*at;
        const size_t begin = *at;
        while (*at < text.size() && is_digit(text[*at])) ++*at;
        return text.substr(begin, *at - begin);
      };
      const std::string_view x = run(a, &i), y = run(b, &j);
      if (x.size() != y.size()) return x.size() < y.size();
      if (x != y) return x < y;
    } else if (a[i] != b[j]) {
      return a[i] < b[j];
    } else {
      ++i;
      ++j;
    }
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;  // "1" and "01" are different files
}

}  // namespace dynamic_slam
