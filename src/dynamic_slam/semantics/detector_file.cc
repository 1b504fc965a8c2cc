#include "dynamic_slam/semantics/detector_file.h"

#include <algorithm>
#include <map>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kRequired[] = {"framework",    "model",           "input.width",
                                          "input.height", "output.decoding", "classes"};

// "person, car", or the lines of a file beside the detector file.
std::vector<std::string> ReadClassNames(const std::string& classes, const fs::path& detector_file) {
  std::vector<std::string> names;
  const fs::path extension = fs::path(classes).extension();
  if (classes.find(',') == std::string::npos && (extension == ".txt" || extension == ".names")) {
    for (const TextLine& line : ReadDataLines(detector_file.parent_path() / classes))
      names.push_back(line.text);
  } else {
    for (size_t begin = 0; begin <= classes.size();) {
      const size_t end = std::min(classes.find(',', begin), classes.size());
      names.emplace_back(Trim(std::string_view(classes).substr(begin, end - begin)));
      begin = end + 1;
    }
  }
  constexpr char kRemedy[] = "Name each class once, in the order of the network's outputs; - is none.";
  std::map<std::string, size_t> first;
  for (size_t i = 0; i < names.size(); ++i) {
    if (names[i].empty()) {
      throw InputError(fmt::format("{}: classes", detector_file.string()),
                       fmt::format("name {} of {} is empty", i + 1, names.size()), kRemedy);
    }
    if (names[i] != "-" && !first.emplace(names[i], i).second) {
      throw InputError(fmt::format("{}: classes", detector_file.string()),
                       fmt::format("'{}' is there twice", names[i]), kRemedy);
    }
  }
  if (names.empty())
    throw InputError(fmt::format("{}: classes", detector_file.string()), "there are none", kRemedy);
  return names;
}

// What one key wants of another.
std::string Conflict(const DetectorOptions& options) {
  const auto is = [](const std::string& value, const char* word) { return value == word; };
  const bool needs_config = is(options.framework, "caffe") || is(options.framework, "darknet");
  if (needs_config && options.config.file.empty()) {
    return fmt::format("a {} network needs config.file too, its {}", options.framework,
                       is(options.framework, "caffe") ? "prototxt" : "cfg");
  }
  if (is(options.output.decoding, "ssd_raw") && options.anchors.file.empty()) {
    return "output.decoding ssd_raw needs anchors.file";
  }
  if (is(options.output.decoding, "yolox") &&
      (options.input.width % 32 != 0 || options.input.height % 32 != 0)) {
    return fmt::format("the input of yolox must be a multiple of 32 px, not {} x {} px", options.input.width,
                       options.input.height);
  }
  return "";
}

}  // namespace

DetectorFile ReadDetectorFile(const fs::path& file) {
  DetectorFile detector{file, file.stem().string(), {}, {}};
  ReadYamlEntries(file, CollectOptions(detector.options), kRequired);
  if (const std::string conflict = Conflict(detector.options); !conflict.empty()) {
    throw InputError(file.string(), conflict, "Correct the detector file.");
  }
  detector.class_names = ReadClassNames(detector.options.classes, file);
  return detector;
}

}  // namespace dynamic_slam
