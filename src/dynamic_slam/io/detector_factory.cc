#include "dynamic_slam/io/detector_factory.h"

#include <algorithm>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/io/box_file.h"
#include "dynamic_slam/semantics/detector_file.h"
#include "dynamic_slam/semantics/hog_detector.h"
#include "dynamic_slam/semantics/network_detector.h"
#include "dynamic_slam/semantics/network_files.h"
#include "dynamic_slam/semantics/replay_detector.h"

namespace dynamic_slam {
namespace {

constexpr std::string_view kBoxesPrefix = "boxes:";

// Rows with one stamp are one set; classes are numbered in the order of their names.
std::unique_ptr<Detector> MakeBoxesDetector(const std::filesystem::path& file) {
  const std::vector<BoxRecord> records = ReadBoxFile(file);
  std::map<std::string, int> class_ids;
  for (const BoxRecord& record : records) class_ids[record.class_name] = 0;
  std::vector<std::string> class_names;
  for (auto& [name, id] : class_ids) {
    id = static_cast<int>(class_names.size());
    class_names.push_back(name);
  }
  std::map<double, DetectionSet> by_stamp;
  for (const BoxRecord& record : records) {
    DetectionSet& set = by_stamp[record.timestamp_s];
    set.timestamp_s = record.timestamp_s;
    set.detections.push_back({record.box, class_ids.at(record.class_name), record.score});
  }
  std::vector<DetectionSet> sets;
  for (auto& [stamp_s, set] : by_stamp) sets.push_back(std::move(set));
  return MakeReplayDetector("boxes", std::move(sets), std::move(class_names));
}

}  // namespace

std::unique_ptr<Detector> MakeDetector(const std::string& spec, const std::filesystem::path& models_folder) {
  if (spec == "none") return nullptr;
  if (spec == "hog") return MakeHogDetector();
  if (spec.starts_with(kBoxesPrefix)) return MakeBoxesDetector(spec.substr(kBoxesPrefix.size()));
  const std::vector<std::string> other_names = {"none", "hog", "boxes:FILE.csv"};
  const std::filesystem::path file = FindConfig("detectors", "detector", spec, other_names);
  return MakeNetworkDetector(ReadDetectorFile(file), ModelFolders(models_folder));
}

std::string DetectorHelp() {
  return fmt::format("none, hog, boxes:FILE.csv, a detector file, or the name of one: {}",
                     fmt::join(ConfigNames("detectors"), ", "));
}

}  // namespace dynamic_slam
