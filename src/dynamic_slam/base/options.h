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

// Reads values from a YAML file: nested maps or dotted keys; absent keys keep their value. Throws InputError
// that lists every problem with file:line (unknown key with a suggestion, wrong type, out of range, given
// twice, key of `required` absent) and then leaves all values unchanged.
void ReadYamlEntries(const std::filesystem::path& file, std::span<const OptionEntry> entries,
                     std::span<const std::string_view> required = {});

// The same for assignments "key=value" from the command line; later ones win.
void ApplySetEntries(std::span<const OptionEntry> entries, std::span<const std::string> assignments);

// All entries as YAML with a comment (help, unit, range) above each key, in field order. Numbers read back
// identically.
std::string EntriesToYaml(std::span<const OptionEntry> entries);

// Throws InputError that lists every value outside its range. For options that were set in code.
void CheckEntryRanges(std::span<const OptionEntry> entries);

template <class Options>
void LoadOptions(const std::filesystem::path& file, Options* options) {
  ReadYamlEntries(file, CollectOptions(*options));
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
