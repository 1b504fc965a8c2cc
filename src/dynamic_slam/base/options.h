#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "dynamic_slam/base/option_field.h"

namespace dynamic_slam {

// One option of a (nested) options struct: where its value is and what is known of it.
struct OptionEntry {
  std::string key;  // dotted: "tracker.min_inliers"
  std::variant<bool*, int*, double*, uint64_t*, std::string*> value;
  OptionField field;  // a range with low >= high is not checked
};

namespace internal {

// The visitor for VisitFields (base/option_field.h) that flattens a struct into entries.
struct OptionCollector {
  std::string prefix;
  std::vector<OptionEntry>* entries;

  template <class T>
  void operator()(std::string_view name, T& value, const OptionField& field) const {
    entries->push_back({prefix + std::string(name), &value, field});
  }
  template <class Nested>
  void operator()(std::string_view name, Nested& nested) const {
    Nested::VisitFields(nested, OptionCollector{prefix + std::string(name) + ".", entries});
  }
};

}  // namespace internal

// The entries of `options`, in field order. They point into `options`, which must outlive them.
template <class Options>
std::vector<OptionEntry> CollectOptions(Options& options) {
  std::vector<OptionEntry> entries;
  Options::VisitFields(options, internal::OptionCollector{"", &entries});
  return entries;
}

// Whether the dotted key is in the section, or in one of its sections.
bool IsBelow(std::string_view key, std::string_view section);

// " Did you mean 'tracker.pose'?" or "": the key or section closest to a misspelt one.
std::string DidYouMeanKey(std::span<const OptionEntry> entries, std::string_view key);

// Reads values from a YAML file: nested maps or dotted keys; absent keys keep their value. Returns the keys
// that the file sets, in field order. Throws InputError that lists every problem with file:line (unknown key
// with a suggestion, wrong type, out of range, given twice, key of `required` absent) and then leaves all
// values unchanged.
std::vector<std::string> ReadYamlEntries(const std::filesystem::path& file,
                                         std::span<const OptionEntry> entries,
                                         std::span<const std::string_view> required = {});

// The same for assignments "key=value" from the command line, or from where `what` says; later ones win.
void ApplySetEntries(std::span<const OptionEntry> entries, std::span<const std::string> assignments,
                     const std::string& what = "--set");

// Whether it is a number with a range.
bool HasRange(const OptionEntry& entry);

// "true or false", "a whole number", "a number", ...
std::string_view WantedType(const OptionEntry& entry);

// The value as in a YAML file; numbers read back identically.
std::string ValueText(const OptionEntry& entry);

// What the value may be, as far as there is a limit: "1 to 200 px", "offline or realtime", or "".
std::string RangeText(const OptionEntry& entry);

// All entries as YAML with a comment (help, unit, range) above each key, in field order.
std::string EntriesToYaml(std::span<const OptionEntry> entries);

// Sentence, type, range and value of the entry `key`, or of all entries of the section `key`. Throws
// InputError with a suggestion when there is neither.
std::string ExplainEntries(std::span<const OptionEntry> entries, const std::string& key);

// A table in Markdown for each section: key, value as the default, unit, range, sentence.
std::string EntriesToMarkdown(std::span<const OptionEntry> entries);

// Throws InputError that lists every value outside its range. For options that were set in code.
void CheckEntryRanges(std::span<const OptionEntry> entries);

template <class Options>
std::vector<std::string> LoadOptions(const std::filesystem::path& file, Options* options) {
  return ReadYamlEntries(file, CollectOptions(*options));
}

template <class Options>
void ApplySet(Options* options, std::span<const std::string> assignments) {
  ApplySetEntries(CollectOptions(*options), assignments);
}

template <class Options>
void ApplySet(Options* options, const std::string& assignment) {
  ApplySetEntries(CollectOptions(*options), std::span(&assignment, 1));
}

template <class Options>
std::string OptionsToYaml(const Options& options) {
  Options copy = options;
  return EntriesToYaml(CollectOptions(copy));
}

template <class Options>
void CheckOptions(const Options& options) {
  Options copy = options;
  CheckEntryRanges(CollectOptions(copy));
}

}  // namespace dynamic_slam
