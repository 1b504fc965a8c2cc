#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/io/box_file.h"
#include "dynamic_slam/report/frame_choice.h"
#include "dynamic_slam/report/report_page.h"
#include "dynamic_slam/system/run_results.h"

namespace dynamic_slam {

// What a report shows of a run beside the system and its summary.
struct RunRecord {
  std::optional<Trajectory> truth;
  std::vector<ChosenFrame> frames;
  // Objects that count, such as people and cars; true ones are known of some sequences only.
  std::vector<BoxRecord> true_boxes = {}, detected = {}, compensated = {};
};

// To be called when the run has ended.
ReportPage MakeRunPage(const std::string& title, const SlamSystem& system, const RunSummary& summary,
                       const RunRecord& record);

// Pictures as JPEG in the page, so wide at most.
nlohmann::ordered_json FramesSection(const std::vector<ChosenFrame>& frames, int width_px = 640);

}  // namespace dynamic_slam
