#include "dynamic_slam/report/report_page.h"

#include <cmath>

#include <fmt/core.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/report/page_parts.h"

namespace dynamic_slam {
namespace {

// Within a script element: nothing in it may look like a tag.
std::string ScriptText(const nlohmann::ordered_json& json) {
  std::string text;
  for (const char c : json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace)) {
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  return text;
}

std::string HtmlText(const std::string& plain) {
  std::string text;
  for (const char c : plain) {
    text += c == '&' ? std::string("&amp;") : c == '<' ? std::string("&lt;") : std::string(1, c);
  }
  return text;
}

}  // namespace

std::string PageText(const ReportPage& page) {
  nlohmann::ordered_json times = nlohmann::ordered_json::array();
  for (const double time_s : page.times_s) times.push_back(Rounded(time_s, 4));
  const nlohmann::ordered_json data = {{"title", page.title},
                                       {"subtitle", page.subtitle},
                                       {"times", std::move(times)},
                                       {"sections", page.sections}};
  // Each mark stands once in the template; what replaces one is not looked at again.
  std::string text;
  std::string_view rest = kPageHtml;
  for (const auto& [mark, part] : {std::pair<std::string_view, std::string>{"@TITLE@", HtmlText(page.title)},
                                   {"@STYLE@", kPageStyle},
                                   {"@DATA@", ScriptText(data)},
                                   {"@SCRIPT@", kPageScript}}) {
    const size_t at = rest.find(mark);
    DS_CHECK(at != std::string_view::npos, "the page has no {}", mark);
    text += rest.substr(0, at);
    text += part;
    rest.remove_prefix(at + mark.size());
  }
  return text + std::string(rest);
}

void WritePage(const std::filesystem::path& file, const ReportPage& page) {
  WriteFileAtomically(file, PageText(page));
}

nlohmann::ordered_json CurvesSection(const std::string& title, const std::vector<CurvePlot>& plots) {
  constexpr int kDigits = 5, kColours = 6;
  nlohmann::ordered_json charts = nlohmann::ordered_json::array();
  for (const CurvePlot& plot : plots) {
    nlohmann::ordered_json curves = nlohmann::ordered_json::array();
    for (size_t i = 0; i < plot.curves.size(); ++i) {
      nlohmann::ordered_json x = nlohmann::ordered_json::array(), y = nlohmann::ordered_json::array();
      for (const Eigen::Vector2d& point : plot.curves[i].points) {
        x.push_back(Rounded(point.x(), kDigits));
        y.push_back(Rounded(point.y(), kDigits));
      }
      curves.push_back({{"name", plot.curves[i].name},
                        {"colour", fmt::format("c{}", 1 + i % kColours)},
                        {"x", std::move(x)},
                        {"y", std::move(y)}});
    }
    charts.push_back({{"title", plot.title},
                      {"xName", plot.x_name},
                      {"yName", plot.y_name},
                      {"xMax", plot.x_max},
                      {"yMax", plot.y_max},
                      {"curves", std::move(curves)}});
  }
  return {{"type", "lines"}, {"title", title}, {"charts", std::move(charts)}};
}

nlohmann::ordered_json Rounded(double value, int digits) {
  if (!std::isfinite(value)) return nullptr;
  const double unit = std::pow(10.0, digits), rounded = std::round(value * unit) / unit;
  if (rounded == std::floor(rounded) && std::abs(rounded) < 1e15) return static_cast<int64_t>(rounded);
  return rounded;
}

}  // namespace dynamic_slam
