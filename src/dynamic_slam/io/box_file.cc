#include "dynamic_slam/io/box_file.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string_view>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

const std::string kHeaders =
    "The first line is `timestamp,class,score,x,y,w,h`, or `timestamp,actor,x,y,w,h,visible` for truth.";

[[noreturn]] void Fail(const fs::path& file, int line, const std::string& reason, const std::string& remedy) {
  throw InputError(fmt::format("{}:{}", file.string(), line), reason, remedy);
}

// The texts between commas, trimmed: unlike SplitColumns, a class name may hold a space.
std::vector<std::string_view> SplitAtCommas(std::string_view line) {
  std::vector<std::string_view> columns;
  while (true) {
    const size_t comma = line.find(',');
    columns.push_back(Trim(line.substr(0, comma)));
    if (comma == std::string_view::npos) return columns;
    line.remove_prefix(comma + 1);
  }
}

// Where the columns are in a row, -1 for those that the file does not have.
struct Header {
  size_t columns = 0;
  int timestamp = -1, class_name = -1, score = -1, visible = -1, x = -1, y = -1, w = -1, h = -1;
};

Header ParseHeader(const fs::path& file, const TextLine& line) {
  const std::vector<std::string_view> names = SplitAtCommas(line.text);
  const auto find = [&](std::string_view name) {
    const auto found = std::find(names.begin(), names.end(), name);
    if (std::count(names.begin(), names.end(), name) > 1) {
      Fail(file, line.number, fmt::format("two columns are called '{}'", name), kHeaders);
    }
    return found == names.end() ? -1 : static_cast<int>(found - names.begin());
  };
  const Header header{names.size(), find("timestamp"), find("class"), find("score"), find("visible"),
                      find("x"),    find("y"),         find("w"),     find("h")};
  for (const auto& [column, name] : {std::pair{header.timestamp, "timestamp"},
                                     {header.x, "x"},
                                     {header.y, "y"},
                                     {header.w, "w"},
                                     {header.h, "h"}}) {
    if (column < 0) Fail(file, line.number, fmt::format("no column is called '{}'", name), kHeaders);
  }
  return header;
}

BoxRecord ParseRow(const fs::path& file, const TextLine& line, const Header& header) {
  const std::vector<std::string_view> columns = SplitAtCommas(line.text);
  if (columns.size() != header.columns) {
    Fail(file, line.number, fmt::format("{} columns, the header has {}", columns.size(), header.columns),
         "Correct the line.");
  }
  const auto number = [&](int column, double low, double high) {
    const std::optional<double> value = ParseDouble(columns[column]);
    if (!value || !std::isfinite(*value)) {
      Fail(file, line.number, fmt::format("'{}' is not a number", columns[column]), "Correct the line.");
    }
    if (*value < low || *value > high) {
      Fail(file, line.number, fmt::format("'{}' is not between {} and {}", columns[column], low, high),
           "Correct the line.");
    }
    return *value;
  };
  constexpr double kFar = 1e9;
  BoxRecord record;
  record.timestamp_s = number(header.timestamp, -1e12, 1e12);
  record.box = {number(header.x, -kFar, kFar), number(header.y, -kFar, kFar), number(header.w, 0, kFar),
                number(header.h, 0, kFar)};
  if (header.score >= 0) record.score = number(header.score, 0, 1);
  if (header.visible >= 0) record.visible = number(header.visible, 0, 1);
  if (header.class_name >= 0) {
    record.class_name = columns[header.class_name];
    if (record.class_name.empty()) Fail(file, line.number, "the class is empty", "Correct the line.");
  }
  return record;
}

}  // namespace

std::vector<BoxRecord> ReadBoxFile(const fs::path& file) {
  const std::vector<TextLine> lines = ReadDataLines(file);
  if (lines.empty()) throw InputError(file.string(), "is empty", kHeaders);
  const Header header = ParseHeader(file, lines.front());
  std::vector<BoxRecord> records;
  records.reserve(lines.size() - 1);
  for (size_t i = 1; i < lines.size(); ++i) records.push_back(ParseRow(file, lines[i], header));
  return records;
}

void WriteBoxFile(const fs::path& file, std::span<const BoxRecord> records) {
  std::string text = "timestamp,class,score,x,y,w,h\n";
  for (const BoxRecord& record : records) {
    DS_CHECK(record.class_name.find_first_of(",\n") == std::string::npos, "class {}", record.class_name);
    fmt::format_to(std::back_inserter(text), "{:.9f},{},{:.6f},{:.3f},{:.3f},{:.3f},{:.3f}\n",
                   record.timestamp_s, record.class_name, record.score, record.box.x, record.box.y,
                   record.box.width, record.box.height);
  }
  WriteFileAtomically(file, text);
}

}  // namespace dynamic_slam
