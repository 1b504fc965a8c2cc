#include "dynamic_slam/base/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <type_traits>

#include <yaml-cpp/yaml.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

using Value = std::variant<bool, int, double, uint64_t, std::string>;

template <class Integer>
std::optional<Value> ParseInteger(std::string_view text) {
  Integer value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// The text as a value of the entry's type; nothing when it is of another type.
std::optional<Value> Parse(const OptionEntry& entry, const std::string& text) {
  return std::visit(
      [&text](const auto* target) -> std::optional<Value> {
        using T = std::remove_const_t<std::remove_pointer_t<decltype(target)>>;
        if constexpr (std::is_same_v<T, bool>) {
          if (text == "true") return true;
          if (text == "false") return false;
          return std::nullopt;
        } else if constexpr (std::is_same_v<T, std::string>) {
          return text;
        } else if constexpr (std::is_same_v<T, double>) {
          return ParseDouble(text);
        } else {
          return ParseInteger<T>(text);
        }
      },
      entry.value);
}

std::string_view WantedType(const OptionEntry& entry) {
  constexpr std::string_view kNames[] = {"true or false", "a whole number", "a number",
                                         "a whole number that is not negative", "a text"};
  return kNames[entry.value.index()];
}

bool HasRange(const OptionEntry& entry) {
  const bool number =
      !std::holds_alternative<bool*>(entry.value) && !std::holds_alternative<std::string*>(entry.value);
  return number && entry.field.low < entry.field.high;
}

std::string WithUnit(const std::string& number, const OptionField& field) {
  return field.unit.empty() ? number : fmt::format("{} {}", number, field.unit);
}

std::string RangeText(const OptionField& field) {
  return WithUnit(fmt::format("{} to {}", field.low, field.high), field);
}

// What is wrong with the value, or "".
std::string RangeProblem(const OptionEntry& entry, const Value& value) {
  return std::visit(
      [&entry](const auto& v) -> std::string {
        if constexpr (std::is_arithmetic_v<std::decay_t<decltype(v)>>) {
          const double number = static_cast<double>(v);
          if (!std::isfinite(number)) return fmt::format("{} is {}, which is not finite", entry.key, v);
          if (HasRange(entry) && !(number >= entry.field.low && number <= entry.field.high)) {
            return fmt::format("{} is {}, outside its range {}", entry.key, v, RangeText(entry.field));
          }
        }
        return "";
      },
      value);
}

Value ValueOf(const OptionEntry& entry) {
  return std::visit([](const auto* target) { return Value(*target); }, entry.value);
}

void Assign(const OptionEntry& entry, const Value& value) {
  std::visit([&value](auto* target) { *target = std::get<std::remove_pointer_t<decltype(target)>>(value); },
             entry.value);
}

// Collects checked values and problems, and applies the values only when there is no problem.
class Assignments {
 public:
  explicit Assignments(std::span<const OptionEntry> entries) : entries_(entries) {
    for (const OptionEntry& entry : entries) {
      keys_.push_back(entry.key);
      for (size_t dot = entry.key.find('.'); dot != std::string::npos; dot = entry.key.find('.', dot + 1)) {
        const std::string section = entry.key.substr(0, dot);
        if (std::find(sections_.begin(), sections_.end(), section) == sections_.end()) {
          sections_.push_back(section);
        }
      }
    }
  }

  bool IsSection(const std::string& key) const {
    return std::find(sections_.begin(), sections_.end(), key) != sections_.end();
  }

  const OptionEntry* Find(const std::string& key) const {
    const auto found = std::find(keys_.begin(), keys_.end(), key);
    return found == keys_.end() ? nullptr : &entries_[static_cast<size_t>(found - keys_.begin())];
  }

  bool Has(const std::string& key) const { return values_.contains(key); }

  void Set(const std::string& where, const OptionEntry& entry, const std::string& text) {
    const std::optional<Value> value = Parse(entry, text);
    if (!value)
      return Problem(where, fmt::format("{} must be {}, is '{}'", entry.key, WantedType(entry), text));
    const std::string problem = RangeProblem(entry, *value);
    if (!problem.empty()) return Problem(where, problem);
    values_[entry.key] = *value;
  }

  void UnknownKey(const std::string& where, const std::string& key) {
    std::vector<std::string> candidates = keys_;
    candidates.insert(candidates.end(), sections_.begin(), sections_.end());
    Problem(where, fmt::format("unknown key '{}'.{}", key, DidYouMean(key, candidates)));
  }

  void Problem(const std::string& where, const std::string& text) {
    problems_.push_back(fmt::format("{}: {}", where, text));
  }

  void Apply(const std::string& what, const std::string& remedy) const {
    if (!problems_.empty()) {
      const std::string count =
          problems_.size() == 1 ? "1 problem" : fmt::format("{} problems", problems_.size());
      throw InputError(what, fmt::format("{}\n  {}", count, fmt::join(problems_, "\n  ")), remedy);
    }
    for (const auto& [key, value] : values_) Assign(*Find(key), value);
  }

 private:
  std::span<const OptionEntry> entries_;
  std::vector<std::string> keys_, sections_;
  std::map<std::string, Value> values_;
  std::vector<std::string> problems_;
};

void ReadMap(const std::string& file, const YAML::Node& map, const std::string& prefix, Assignments* out,
             std::map<std::string, int>* first_lines) {
  for (const auto& item : map) {
    const int line = item.first.Mark().line + 1;
    const std::string where = fmt::format("{}:{}", file, line);
    if (!item.first.IsScalar()) {
      out->Problem(where, "a key must be a plain word");
      continue;
    }
    const std::string key = prefix + item.first.Scalar();
    const auto [first, is_new] = first_lines->emplace(key, line);
    if (!is_new) {
      out->Problem(where, fmt::format("{} is given a second time, first in line {}", key, first->second));
    } else if (out->IsSection(key)) {
      if (item.second.IsMap()) {
        ReadMap(file, item.second, key + ".", out, first_lines);
      } else if (!item.second.IsNull()) {
        out->Problem(where, fmt::format("{} is a section: write its keys below it, indented", key));
      }
    } else if (const OptionEntry* entry = out->Find(key); entry == nullptr) {
      out->UnknownKey(where, key);
    } else if (!item.second.IsScalar()) {
      out->Problem(where, fmt::format("{} must be {}", key, WantedType(*entry)));
    } else {
      out->Set(where, *entry, item.second.Scalar());
    }
  }
}

// A YAML text in double quotes.
std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      quoted += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string ValueText(const OptionEntry& entry) {
  return std::visit(
      [](const auto& v) -> std::string {
        using T = std::decay_t<decltype(v)>;
        if constexpr (std::is_same_v<T, std::string>) return Quoted(v);
        if constexpr (std::is_same_v<T, double>) return ShortestDouble(v);
        if constexpr (!std::is_same_v<T, std::string>) return fmt::format("{}", v);
      },
      ValueOf(entry));
}

}  // namespace

void ReadYamlEntries(const std::filesystem::path& file, std::span<const OptionEntry> entries,
                     std::span<const std::string_view> required) {
  const std::string name = file.string();
  YAML::Node root;
  try {
    root = YAML::Load(ReadFile(file, "Check the path."));
  } catch (const YAML::ParserException& e) {
    throw InputError(fmt::format("{}:{}", name, e.mark.line + 1), fmt::format("is not YAML: {}", e.msg),
                     "Write 'key: value' lines; indent the keys of a section with spaces.");
  }
  Assignments assignments(entries);
  std::map<std::string, int> first_lines;
  if (root.IsMap()) {
    ReadMap(name, root, "", &assignments, &first_lines);
  } else if (!root.IsNull()) {
    assignments.Problem(name + ":1", "'key: value' lines are wanted");
  }
  for (const std::string_view key : required) {
    if (!first_lines.contains(std::string(key))) {
      assignments.Problem(name, fmt::format("the key '{}' is missing", key));
    }
  }
  assignments.Apply(name, "Correct the file and try again.");
}

void ApplySetEntries(std::span<const OptionEntry> entries, std::span<const std::string> settings) {
  Assignments assignments(entries);
  for (const std::string& setting : settings) {
    const std::string where = "--set " + setting;
    const size_t equals = setting.find('=');
    if (equals == std::string::npos) {
      assignments.Problem(where, "write key=value");
      continue;
    }
    const std::string key(Trim(std::string_view(setting).substr(0, equals)));
    const std::string text(Trim(std::string_view(setting).substr(equals + 1)));
    if (const OptionEntry* entry = assignments.Find(key)) {
      assignments.Set(where, *entry, text);
    } else if (assignments.IsSection(key)) {
      assignments.Problem(where, fmt::format("{} is a section: write {}.key=value", key, key));
    } else {
      assignments.UnknownKey(where, key);
    }
  }
  assignments.Apply("--set", "A run's config.yaml lists every key with its range.");
}

std::string EntriesToYaml(std::span<const OptionEntry> entries) {
  std::string yaml;
  std::vector<std::string> open;  // the sections around the previous key
  for (const OptionEntry& entry : entries) {
    std::vector<std::string> path;
    for (size_t begin = 0; begin <= entry.key.size();) {
      const size_t end = std::min(entry.key.find('.', begin), entry.key.size());
      path.push_back(entry.key.substr(begin, end - begin));
      begin = end + 1;
    }
    const std::string name = path.back();
    path.pop_back();
    size_t depth = 0;
    while (depth < std::min(path.size(), open.size()) && path[depth] == open[depth]) ++depth;
    for (; depth < path.size(); ++depth) yaml += fmt::format("{:{}}{}:\n", "", 2 * depth, path[depth]);
    const std::string range = HasRange(entry)            ? fmt::format(" [{}]", RangeText(entry.field))
                              : entry.field.unit.empty() ? std::string()
                                                         : fmt::format(" [{}]", entry.field.unit);
    if (!entry.field.help.empty() || !range.empty()) {
      yaml += fmt::format("{:{}}#{}{}{}\n", "", 2 * depth, entry.field.help.empty() ? "" : " ",
                          entry.field.help, range);
    }
    yaml += fmt::format("{:{}}{}: {}\n", "", 2 * depth, name, ValueText(entry));
    open = path;
  }
  return yaml;
}

void CheckEntryRanges(std::span<const OptionEntry> entries) {
  Assignments assignments(entries);
  for (const OptionEntry& entry : entries) {
    const std::string problem = RangeProblem(entry, ValueOf(entry));
    if (!problem.empty()) assignments.Problem("option", problem);
  }
  assignments.Apply("options", "Set each within its range.");
}

}  // namespace dynamic_slam
