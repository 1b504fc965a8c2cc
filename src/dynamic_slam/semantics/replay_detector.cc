#include "dynamic_slam/semantics/replay_detector.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

bool IsEarlier(const DetectionSet& a, const DetectionSet& b) { return a.timestamp_s < b.timestamp_s; }

double Tolerance(const std::vector<DetectionSet>& sets) {
  constexpr double kMaxTolerance_s = 0.01;
  if (sets.size() < 2) return kMaxTolerance_s;
  std::vector<double> steps_s;
  for (size_t i = 1; i < sets.size(); ++i) steps_s.push_back(sets[i].timestamp_s - sets[i - 1].timestamp_s);
  const auto median = steps_s.begin() + static_cast<std::ptrdiff_t>(steps_s.size() / 2);
  std::nth_element(steps_s.begin(), median, steps_s.end());
  return std::min(kMaxTolerance_s, 0.5 * *median);
}

class ReplayDetector : public Detector {
 public:
  ReplayDetector(const std::string& name, std::vector<DetectionSet> sets,
                 std::vector<std::string> class_names)
      : Detector(name, std::move(class_names)), sets_(std::move(sets)), tolerance_s_(Tolerance(sets_)) {
    DS_CHECK(std::is_sorted(sets_.begin(), sets_.end(), IsEarlier), "{} sets", sets_.size());
  }

  void SetPreparation(const BoxMapping& mapping) override { mapping_ = mapping; }
  bool ReadsPixels() const override { return false; }

 private:
  std::vector<Detection> Find(const cv::Mat&, FrameId, double timestamp_s) override {
    auto nearest = std::lower_bound(sets_.begin(), sets_.end(), DetectionSet{{}, timestamp_s, {}}, IsEarlier);
    if (nearest != sets_.begin() && (nearest == sets_.end() || timestamp_s - std::prev(nearest)->timestamp_s <
                                                                   nearest->timestamp_s - timestamp_s)) {
      --nearest;
    }
    if (nearest == sets_.end() || !(std::abs(nearest->timestamp_s - timestamp_s) <= tolerance_s_)) return {};
    std::vector<Detection> detections = nearest->detections;
    for (Detection& detection : detections) detection.box = mapping_(detection.box);
    return detections;
  }

  std::vector<DetectionSet> sets_;
  double tolerance_s_;
  BoxMapping mapping_;
};

}  // namespace

std::unique_ptr<Detector> MakeReplayDetector(const std::string& name, std::vector<DetectionSet> sets,
                                             std::vector<std::string> class_names) {
  return std::make_unique<ReplayDetector>(name, std::move(sets), std::move(class_names));
}

}  // namespace dynamic_slam
