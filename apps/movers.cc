#include "movers.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>

#include "dynamic_slam/semantics/dynamic_prior.h"
#include "dynamic_slam/semantics/dynamic_score.h"

namespace dynamic_slam {
namespace {

constexpr double kMinTrueHeightPx = 30;

Box Clipped(const Box& box, const Box& to) {
  const double x = std::max(box.x, to.x), y = std::max(box.y, to.y);
  return {x, y, std::max(0.0, std::min(box.x + box.width, to.x + to.width) - x),
          std::max(0.0, std::min(box.y + box.height, to.y + to.height) - y)};
}

int64_t Microseconds(double stamp_s) { return std::llround(stamp_s * 1e6); }

}  // namespace

std::vector<BoxRecord> MoversOf(std::vector<BoxRecord> records) {
  const DynamicPrior prior = LoadDynamicPrior("dynamic_prior");
  const double threshold = DynamicScoreOptions().threshold;
  std::erase_if(records,
                [&](const BoxRecord& record) { return prior.Score(record.class_name) <= threshold; });
  return records;
}

std::filesystem::path TrueBoxes(const std::filesystem::path& sequence) { return sequence / "boxes.csv"; }

std::vector<BoxRecord> TrueMovers(const std::filesystem::path& sequence, std::span<const double> stamps_s,
                                  const ImagePreparer& preparer) {
  if (!std::filesystem::exists(TrueBoxes(sequence))) return {};
  std::set<int64_t> wanted;
  for (const double stamp_s : stamps_s) wanted.insert(Microseconds(stamp_s));
  std::vector<BoxRecord> movers = MoversOf(ReadBoxFile(TrueBoxes(sequence)));
  std::erase_if(movers,
                [&](const BoxRecord& record) { return !wanted.contains(Microseconds(record.timestamp_s)); });
  const BoxMapping mapping = preparer.box_mapping();
  const Box view{0, 0, static_cast<double>(preparer.camera().width),
                 static_cast<double>(preparer.camera().height)};
  for (BoxRecord& record : movers) {
    const Box whole = mapping(record.box);
    record.box = Clipped(whole, view);
    if (whole.Area() > 0) record.visible *= record.box.Area() / whole.Area();
    if (record.box.height < kMinTrueHeightPx) record.visible = 0;
  }
  return movers;
}

}  // namespace dynamic_slam
