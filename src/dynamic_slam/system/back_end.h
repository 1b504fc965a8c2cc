#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <stop_token>
#include <vector>

#include "dynamic_slam/base/guarded.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/loop/loop_closer.h"
#include "dynamic_slam/map/shared_map.h"
#include "dynamic_slam/mapping/local_mapper.h"
#include "dynamic_slam/system/executor.h"
#include "dynamic_slam/system/system_options.h"

namespace dynamic_slam {

// What local mapping has done so far.
struct MappingReport {
  std::vector<double> times_ms;  // of each keyframe
  int landmarks_created = 0, landmarks_culled = 0, landmarks_merged = 0;
  int keyframes_culled = 0;
  int bundles_stopped = 0;      // adjustments that ended early, since keyframes were waiting
  int keyframes_abandoned = 0;  // whose map was given up
};

// What the search for loops has found so far.
struct LoopReport {
  // Of all keyframes, in their order, then of the borders of parts, then of parts; a reason says why one was
  // refused.
  std::vector<LoopAttempt> attempts;
  int linked = 0;     // places known again where nothing had to be moved
  int corrected = 0;  // loops after which the map was moved
  int joined = 0;     // of these, those that made one of two parts of the map
  int landmarks_merged = 0;
  int revisit_links = 0;                 // of keyframes to what the map has from another time, at the end
  int bundles = 0, bundles_stopped = 0;  // adjustments of the whole map after that
  std::vector<double> times_ms;          // of each keyframe, and each border, that was looked at
};

struct BackEndReports {
  MappingReport mapping;
  LoopReport loops;
};

// Local mapping and, behind it, the search for loops, each in its lane of the executor. Public calls come
// from one thread, but for those that read a report.
class BackEnd {
 public:
  struct MappedKeyframe {
    KeyframeId id;
    uint32_t epoch;  // of the map
  };

  // The camera, the options and the executor must outlive it.
  BackEnd(const Camera& camera, const SystemOptions& options, SharedMap* map, Executor* executor);

  // Local mapping is to do its work with a keyframe that was put into the map of this epoch.
  void PostMapping(KeyframeId keyframe, uint32_t epoch);
  void DrainMapping() { executor_->Drain(Lane::kMapping); }
  // Loops are to be looked for at the keyframes that local mapping has done since the last call.
  void PostLoops();
  void Drain();  // both

  // Keyframes that local mapping has done and that were not looked at for loops yet.
  std::vector<MappedKeyframe> mapped() const { return *mapped_.Read(); }

  // Adjusts the map where the loop closer moved it, and reports. start: of the search.
  void FinishLoop(const LoopResult& result, std::chrono::steady_clock::time_point start,
                  const std::function<bool()>& should_stop);
  void ReportRevisits(int links) { loop_report_.Write()->revisit_links = links; }

  // For calls from the thread of the others, when the lanes are drained.
  LocalMapper& mapper() { return mapper_; }
  LoopCloser& loop_closer() { return loop_closer_; }

  MappingReport mapping_report() const { return *mapping_report_.Read(); }
  LoopReport loop_report() const { return *loop_report_.Read(); }
  BackEndReports reports() const { return {mapping_report(), loop_report()}; }
  // As it was when it had these reports; nothing waits.
  void Restore(const BackEndReports& reports);

 private:
  void MapKeyframe(KeyframeId keyframe, uint32_t epoch, const std::stop_token& token);
  void CloseLoop(const MappedKeyframe& keyframe, const std::stop_token& token);

  const Camera& camera_;
  const SystemOptions& options_;
  SharedMap* map_;
  Executor* executor_;
  LocalMapper mapper_;
  LoopCloser loop_closer_;
  Guarded<MappingReport> mapping_report_;
  Guarded<LoopReport> loop_report_;
  Guarded<std::vector<MappedKeyframe>> mapped_;
};

}  // namespace dynamic_slam
