#include "dynamic_slam/system/back_end.h"

#include <utility>

#include "dynamic_slam/base/stopwatch.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/mapping/map_bundle.h"

namespace dynamic_slam {

BackEnd::BackEnd(const Camera& camera, const SystemOptions& options, SharedMap* map, Executor* executor)
    : camera_(camera),
      options_(options),
      map_(map),
      executor_(executor),
      mapper_(camera, options.mapper, map),
      loop_closer_(camera, options.loop, options.seed, map) {}

void BackEnd::PostMapping(KeyframeId keyframe, uint32_t epoch) {
  executor_->Post(Lane::kMapping, [this, keyframe, epoch](const std::stop_token& token) {
    MapKeyframe(keyframe, epoch, token);
  });
}

void BackEnd::MapKeyframe(KeyframeId keyframe, uint32_t epoch, const std::stop_token& token) {
  const auto start = std::chrono::steady_clock::now();
  const MappingResult result = mapper_.Process(keyframe, epoch, [this, &token] {
    return token.stop_requested() ||
           executor_->Waiting(Lane::kMapping) >= options_.mapper.interrupting_keyframes;
  });
  if (options_.loop.enabled && !result.abandoned) mapped_.Write()->push_back({keyframe, epoch});
  auto report = mapping_report_.Write();
  report->times_ms.push_back(MillisecondsSince(start));
  report->landmarks_created += result.created;
  report->landmarks_culled += result.culled_landmarks;
  report->landmarks_merged += result.merged_landmarks;
  report->keyframes_culled += result.culled_keyframes;
  report->bundles_stopped += result.bundle.stopped;
  report->keyframes_abandoned += result.abandoned;
}

void BackEnd::PostLoops() {
  std::vector<MappedKeyframe> mapped;
  std::swap(mapped, *mapped_.Write());
  for (const MappedKeyframe& keyframe : mapped) {
    executor_->Post(Lane::kLoop,
                    [this, keyframe](const std::stop_token& token) { CloseLoop(keyframe, token); });
  }
}

void BackEnd::CloseLoop(const MappedKeyframe& keyframe, const std::stop_token& token) {
  const auto start = std::chrono::steady_clock::now();
  const auto should_stop = [&token] { return token.stop_requested(); };
  FinishLoop(loop_closer_.Process(keyframe.id, keyframe.epoch, should_stop), start, should_stop);
}

void BackEnd::FinishLoop(const LoopResult& result, std::chrono::steady_clock::time_point start,
                         const std::function<bool()>& should_stop) {
  std::optional<BundleSummary> bundle;
  if (result.corrected && options_.loop.full_bundle) {
    bundle = AdjustAll(camera_, options_.mapper, should_stop, map_);
  }
  auto report = loop_report_.Write();
  report->attempts.insert(report->attempts.end(), result.attempts.begin(), result.attempts.end());
  report->linked += result.linked && !result.corrected;
  report->corrected += result.corrected;
  report->joined += result.joined;
  report->landmarks_merged += result.landmarks_merged;
  report->bundles += bundle.has_value();
  report->bundles_stopped += bundle.has_value() && bundle->stopped;
  report->times_ms.push_back(MillisecondsSince(start));
}

void BackEnd::Drain() {
  executor_->Drain(Lane::kMapping);
  PostLoops();
  executor_->Drain(Lane::kLoop);
}

void BackEnd::Restore(const BackEndReports& reports) {
  *mapping_report_.Write() = reports.mapping;
  *loop_report_.Write() = reports.loops;
  mapped_.Write()->clear();
}

}  // namespace dynamic_slam
