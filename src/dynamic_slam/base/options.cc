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

// What is wrong with a value of the right type, or "".
std::string ValueProblem(const OptionEntry& entry, const Value& value) {
  return std::visit(
      [&entry](const auto& v) -> std::string {
        const std::span<const std::string_view> words = entry.field.words;
        if constexpr (std::is_same_v<std::decay_t<decltype(v)>, std::string>) {
          if (!words.empty() && std::find(words.begin(), words.end(), v) == words.end()) {
            return fmt::format("{} must be {}, is '{}'.{}", entry.key, RangeText(entry), v,
                               DidYouMean(v, std::vector<std::string>(words.begin(), words.end())));
          }
        } else if constexpr (std::is_arithmetic_v<std::decay_t<decltype(v)>>) {
          const double number = static_cast<double>(v);
          if (!std::isfinite(number)) return fmt::format("{} is {}, which is not finite", entry.key, v);
          if (HasRange(entry) && !(number >= entry.field.low && number <= entry.field.high)) {
            return fmt::format("{} is {}, outside its range {}", entry.key, v, RangeText(entry));
          }
        }
        return "";
      },
      value);
}

void Assign(const OptionEntry& entry, const Value& value) {
  std::visit([&value](auto* target) { *target = std::get<std::remove_pointer_t<decltype(target)>>(value); },
             entry.value);
}

// Collects checked values and problems, and applies the values only when there is no problem.
class Assignments {
 public:
  explicit Assignments(std::span<const OptionEntry> entries) : entries_(entries) {}

  bool IsSection(const std::string& key) const {
    return std::any_of(entries_.begin(), entries_.end(),
                       [&key](const OptionEntry& entry) { return IsBelow(entry.key, key); });
  }

  const OptionEntry* Find(const std::string& key) const {
    const auto found = std::find_if(entries_.begin(), entries_.end(),
                                    [&key](const OptionEntry& entry) { return entry.key == key; });
    return found == entries_.end() ? nullptr : &*found;
  }

  void Set(const std::string& where, const OptionEntry& entry, const std::string& text) {
    const std::optional<Value> value = Parse(entry, text);
    if (!value)
      return Problem(where, fmt::format("{} must be {}, is '{}'", entry.key, WantedType(entry), text));
    const std::string problem = ValueProblem(entry, *value);
    if (!problem.empty()) return Problem(where, problem);
    values_[entry.key] = *value;
  }

  void UnknownKey(const std::string& where, const std::string& key) {
    Problem(where, fmt::format("unknown key '{}'.{}", key, DidYouMeanKey(entries_, key)));
  }

  void Problem(const std::string& where, const std::string& text) {
    problems_.push_back(fmt::format("{}: {}", where, text));
  }

  // Returns the keys that are set, in field order.
  std::vector<std::string> Apply(const std::string& what, const std::string& remedy) const {
    if (!problems_.empty()) {
      const std::string count =
          problems_.size() == 1 ? "1 problem" : fmt::format("{} problems", problems_.size());
      throw InputError(what, fmt::format("{}\n  {}", count, fmt::join(problems_, "\n  ")), remedy);
    }
    std::vector<std::string> keys;
    for (const OptionEntry& entry : entries_) {
      const auto found = values_.find(entry.key);
      if (found == values_.end()) continue;
      Assign(entry, found->second);
      keys.push_back(entry.key);
    }
    return keys;
  }

 private:
  std::span<const OptionEntry> entries_;
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

}  // namespace

bool IsBelow(std::string_view key, std::string_view section) {
  return key.size() > section.size() && key.starts_with(section) && key[section.size()] == '.';
}

std::string DidYouMeanKey(std::span<const OptionEntry> entries, std::string_view key) {
  std::vector<std::string> candidates;
  for (const OptionEntry& entry : entries) candidates.push_back(entry.key);
  for (const OptionEntry& entry : entries) {
    for (size_t dot = entry.key.find('.'); dot != std::string::npos; dot = entry.key.find('.', dot + 1)) {
      candidates.push_back(entry.key.substr(0, dot));
    }
  }
  return DidYouMean(key, candidates);
}

std::vector<std::string> ReadYamlEntries(const std::filesystem::path& file,
                                         std::span<const OptionEntry> entries,
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
  return assignments.Apply(name, "Correct the file and try again.");
}

void ApplySetEntries(std::span<const OptionEntry> entries, std::span<const std::string> settings,
                     const std::string& what) {
  Assignments assignments(entries);
  for (const std::string& setting : settings) {
    const std::string where = what + " " + setting;
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
  assignments.Apply(what, "A run's config.yaml lists every key with its range.");
}

void CheckEntryRanges(std::span<const OptionEntry> entries) {
  Assignments assignments(entries);
  for (const OptionEntry& entry : entries) {
    const std::string problem =
        ValueProblem(entry, std::visit([](const auto* v) { return Value(*v); }, entry.value));
    if (!problem.empty()) assignments.Problem("option", problem);
  }
  assignments.Apply("options", "Set each within its range.");
}

}  // namespace dynamic_slam
