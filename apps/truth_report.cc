#include "truth_report.h"

#include <fmt/core.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/trajectory_file.h"

namespace dynamic_slam {
namespace {

constexpr int kPictureWidthPx = 900, kPictureHeightPx = 700;

}  // namespace

std::optional<Trajectory> FindTruth(const std::filesystem::path& source) {
  try {
    return LoadGroundTruth(source);
  } catch (const InputError& error) {
    fmt::print("no APE: {}\n", error.what());
    return std::nullopt;
  }
}

void ReportTruth(const Trajectory& truth, const Trajectory& estimate, const Trajectory& live,
                 const std::filesystem::path& out) {
  if (estimate.empty()) return;
  try {
    const TruthComparison comparison = CompareWithTruth(truth, estimate);
    const std::optional<std::string> live_ape = DescribeLiveApe(truth, estimate, live);
    fmt::print("APE against the ground truth, after sim(3) alignment: {}{}\n", DescribeApe(comparison),
               live_ape.has_value() ? "; " + *live_ape : "");
    TrajectoryPlot plot = PlotOverTruth(comparison, estimate);
    plot.title = fmt::format("{}: APE {}", out.filename().string(), DescribeApe(comparison));
    WritePicture((out / "trajectory.png").string(), DrawPlot(plot, kPictureWidthPx, kPictureHeightPx));
  } catch (const InputError& error) {
    fmt::print("no APE: {}\n", error.what());
  }
}

}  // namespace dynamic_slam
