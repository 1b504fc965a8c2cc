#include "dynamic_slam/semantics/detection_exchange.h"

#include <algorithm>
#include <utility>

namespace dynamic_slam {

void DetectionExchange::Write(DetectionResult result) {
  {
    MutexLock lock(mutex_);
    if (results_.size() == kMostResults) results_.pop_front();
    results_.push_back(std::move(result));
  }
  written_.NotifyAll();
}

std::optional<DetectionResult> DetectionExchange::Read(FrameId frame,
                                                       std::chrono::steady_clock::time_point deadline) {
  MutexLock lock(mutex_);
  bool in_time = true;
  while (true) {
    const auto found = std::find_if(results_.begin(), results_.end(),
                                    [frame](const DetectionResult& result) { return result.frame == frame; });
    if (found != results_.end()) {
      DetectionResult result = std::move(*found);
      results_.erase(found);
      return result;
    }
    if (!in_time) return std::nullopt;
    in_time = written_.WaitUntil(mutex_, deadline);
  }
}

std::vector<DetectionResult> DetectionExchange::ReadAll() {
  MutexLock lock(mutex_);
  std::vector<DetectionResult> all(std::make_move_iterator(results_.begin()),
                                   std::make_move_iterator(results_.end()));
  results_.clear();
  return all;
}

}  // namespace dynamic_slam
