#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "dynamic_slam/eval/curve_plot.h"

namespace dynamic_slam {

// A page that opens from disk, without a network: report/page with the data in it.
struct ReportPage {
  std::string title, subtitle;
  std::vector<double> times_s;  // moments that the cursor stops at, ascending, from 0
  // Each has a "type", one of the functions of `draw` in page/sections.js, which says what else it has, and
  // may have a "title", a "note", and a "short" title for the contents.
  nlohmann::ordered_json sections = nlohmann::ordered_json::array();
};

std::string PageText(const ReportPage& page);

// Throws InputError when the file cannot be written.
void WritePage(const std::filesystem::path& file, const ReportPage& page);

// A section with the curves of the plots, in colours of the page.
nlohmann::ordered_json CurvesSection(const std::string& title, const std::vector<CurvePlot>& plots);

// The value to so many digits behind the point, as short as JSON can say it; null when it is not finite.
nlohmann::ordered_json Rounded(double value, int digits);

}  // namespace dynamic_slam
