#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace dynamic_slam {

// Edits (insert, delete, replace, swap neighbours) that turn a into b.
int EditDistance(std::string_view a, std::string_view b);

// The candidate closest to `name`, or nothing when none is close enough to be a misspelling of it.
std::optional<std::string> ClosestName(std::string_view name, std::span<const std::string> candidates);

// " Did you mean 'fx'?" or "".
std::string DidYouMean(std::string_view name, std::span<const std::string> candidates);

// The whole text as a number, independent of the locale; nothing when it is anything else.
std::optional<double> ParseDouble(std::string_view text);

// The shortest decimal text that reads back as the same number, with ".0" where it would look like an
// integer.
std::string ShortestDouble(double value);

// The text in double quotes, as YAML and JSON have it.
std::string Quoted(std::string_view text);

std::string_view Trim(std::string_view text);

// Columns separated by white space and by any of `more_separators`.
std::vector<std::string_view> SplitColumns(std::string_view line, std::string_view more_separators = "");

struct TextLine {
  int number = 0;  // 1 is the first line of the file
  std::string text;
};

// The lines of a text file that are neither blank nor comments (#), trimmed. Throws InputError when the file
// cannot be read.
std::vector<TextLine> ReadDataLines(const std::filesystem::path& file);

// The bytes of a file; of a pipe or a device at most 64 MB. Throws InputError when it cannot be read;
// `remedy` is the last sentence of the message.
std::string ReadFile(const std::filesystem::path& file, const std::string& remedy = "");

// Writes FILE.tmp to the disk and renames it to FILE, so that FILE is never half written, whenever the
// program or the machine stops; makes the folder. Throws InputError.
void WriteFileAtomically(const std::filesystem::path& file, std::string_view content);

// Throws InputError when WriteFileAtomically would, as far as that can be known before; makes the folder.
void CheckCanBeWritten(const std::filesystem::path& file);

}  // namespace dynamic_slam
