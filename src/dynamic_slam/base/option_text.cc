#include <algorithm>
#include <type_traits>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"

// What is written of options; what is read is in options.cc.

namespace dynamic_slam {
namespace {

std::string WithUnit(const std::string& number, const OptionField& field) {
  return field.unit.empty() ? number : fmt::format("{} {}", number, field.unit);
}

std::string NumberRange(const OptionField& field) { return fmt::format("{} to {}", field.low, field.high); }

std::string Words(const OptionField& field, std::string_view quote) {
  std::string text;
  for (size_t i = 0; i < field.words.size(); ++i) {
    if (i > 0) text += i + 1 == field.words.size() ? " or " : ", ";
    text += fmt::format("{}{}{}", quote, field.words[i], quote);
  }
  return text;
}

// The part of a key before its last dot, or "".
std::string_view SectionOf(std::string_view key) {
  const size_t dot = key.rfind('.');
  return dot == std::string_view::npos ? std::string_view() : key.substr(0, dot);
}

}  // namespace

bool HasRange(const OptionEntry& entry) {
  const bool number =
      !std::holds_alternative<bool*>(entry.value) && !std::holds_alternative<std::string*>(entry.value);
  return number && entry.field.low < entry.field.high;
}

std::string_view WantedType(const OptionEntry& entry) {
  constexpr std::string_view kNames[] = {"true or false", "a whole number", "a number",
                                         "a whole number that is not negative", "a text"};
  return kNames[entry.value.index()];
}

std::string ValueText(const OptionEntry& entry) {
  return std::visit(
      [](const auto* v) -> std::string {
        using T = std::remove_const_t<std::remove_pointer_t<decltype(v)>>;
        if constexpr (std::is_same_v<T, std::string>) {
          return Quoted(*v);
        } else if constexpr (std::is_same_v<T, double>) {
          return ShortestDouble(*v);
        } else {
          return fmt::format("{}", *v);
        }
      },
      entry.value);
}

std::string RangeText(const OptionEntry& entry) {
  if (std::holds_alternative<std::string*>(entry.value)) return Words(entry.field, "");
  return HasRange(entry) ? WithUnit(NumberRange(entry.field), entry.field) : "";
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
    std::string range = RangeText(entry);
    if (range.empty()) range = entry.field.unit;
    if (!range.empty()) range = fmt::format(" [{}]", range);
    if (!entry.field.help.empty() || !range.empty()) {
      yaml += fmt::format("{:{}}#{}{}{}\n", "", 2 * depth, entry.field.help.empty() ? "" : " ",
                          entry.field.help, range);
    }
    yaml += fmt::format("{:{}}{}: {}\n", "", 2 * depth, name, ValueText(entry));
    open = path;
  }
  return yaml;
}

std::string ExplainEntries(std::span<const OptionEntry> entries, const std::string& key) {
  std::string text;
  for (const OptionEntry& entry : entries) {
    if (entry.key != key && !IsBelow(entry.key, key)) continue;
    const std::string range = RangeText(entry);
    text += fmt::format("{}{}\n  {}\n  {}{}{}, default {}\n", text.empty() ? "" : "\n", entry.key,
                        entry.field.help, WantedType(entry), range.empty() ? "" : ": ", range,
                        WithUnit(ValueText(entry), entry.field));
  }
  if (text.empty()) {
    throw InputError(fmt::format("'{}'", key),
                     fmt::format("there is no such option.{}", DidYouMeanKey(entries, key)),
                     "Give a key, such as orb.features, or a section, such as orb.");
  }
  return text;
}

std::string EntriesToMarkdown(std::span<const OptionEntry> entries) {
  std::vector<std::string_view> sections;
  for (const OptionEntry& entry : entries) {
    const std::string_view section = SectionOf(entry.key);
    if (std::find(sections.begin(), sections.end(), section) == sections.end()) sections.push_back(section);
  }
  std::string page;
  for (const std::string_view section : sections) {
    page += section.empty() ? "## General\n\n" : fmt::format("## `{}`\n\n", section);
    page += "| key | default | unit | range | what it does |\n|---|---|---|---|---|\n";
    for (const OptionEntry& entry : entries) {
      if (SectionOf(entry.key) != section) continue;
      const std::string range = HasRange(entry)              ? NumberRange(entry.field)
                                : !entry.field.words.empty() ? Words(entry.field, "`")
                                                             : std::string(WantedType(entry));
      page += fmt::format("| `{}` | `{}` | {} | {} | {} |\n", entry.key, ValueText(entry), entry.field.unit,
                          range, entry.field.help);
    }
    page += '\n';
  }
  page.pop_back();
  return page;
}

}  // namespace dynamic_slam
