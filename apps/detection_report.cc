#include "detection_report.h"

#include <cmath>
#include <cstdint>
#include <set>
#include <vector>

#include <fmt/core.h>

#include "dynamic_slam/eval/detection_metrics.h"

namespace dynamic_slam {
namespace {

int64_t Microseconds(double stamp_s) { return std::llround(stamp_s * 1e6); }

void PrintRow(const std::string& name, const DetectionMetrics& m) {
  fmt::print("{:<10}{:>8.3f}{:>11.3f}{:>11.3f}{:>17.3f}{:>17.3f}\n", name, m.Recall(), m.Precision(),
             m.MissRate(), m.FrameRecall(), m.CompleteFrameRecall());
}

}  // namespace

void PrintDetectionReport(std::span<const BoxRecord> truth, std::span<const double> stamps_s,
                          std::span<const BoxRecord> detected, const std::string& compensation,
                          std::span<const BoxRecord> compensated) {
  std::set<int64_t> stamps;
  for (const double stamp_s : stamps_s) stamps.insert(Microseconds(stamp_s));
  std::vector<BoxRecord> wanted;
  for (const BoxRecord& record : truth) {
    if (stamps.contains(Microseconds(record.timestamp_s))) wanted.push_back(record);
  }
  const DetectionMetrics raw = CompareBoxes(wanted, detected, {});
  if (raw.frames == 0) {
    fmt::print("no true box of a person at the times of these images: nothing to compare\n");
    return;
  }
  fmt::print("{} true boxes of persons in {} frames (at least half visible; IoU of 0.5, one to one)\n",
             raw.hits + raw.misses, raw.frames);
  fmt::print("{:<10}{:>8}{:>11}{:>11}{:>17}{:>17}\n", "", "recall", "precision", "miss rate",
             "frames with one", "frames with all");
  PrintRow("detector", raw);
  if (compensation != "none") PrintRow(compensation, CompareBoxes(wanted, compensated, {}));
}

}  // namespace dynamic_slam
