#include "dynamic_slam/tracking/late_judgement.h"

#include <algorithm>
#include <vector>

#include "dynamic_slam/map/static_evidence.h"
#include "dynamic_slam/semantics/box_compensation.h"

namespace dynamic_slam {

void LateJudgement::Remember(FrameId frame, KeyframeId keyframe) {
  recent_.emplace_back(frame, keyframe);
  // No answer reaches farther back.
  while (frame.value() - recent_.front().first.value() > BoxCompensation::kHistoryFrames) recent_.pop_front();
}

void LateJudgement::Judge(std::span<const LateObjects> late, const DynamicFilter& filter,
                          Initializer* initializer, SharedMap* map) {
  if (late.empty()) return;
  const auto oldest = std::find_if(recent_.begin(), recent_.end(), [&](const auto& keyframe) {
    return keyframe.first >= late.front().frame;
  });
  for (const LateObjects& objects : late) {
    initializer->ForEachReference([&](Frame* reference) {
      if (reference->id != objects.frame) return;
      filter.JudgeLate(objects.boxes, reference->features, &reference->static_probability);
      // How these moved nobody watched: a start does without them.
      for (float& p : reference->static_probability) p = p < kMinStaticProbability ? 0 : p;
    });
    for (auto keyframe = oldest; keyframe != recent_.end(); ++keyframe) {
      if (keyframe->first != objects.frame) continue;
      JudgeKeyframe(keyframe->second, oldest->second, objects.boxes, filter, map->Write().get());
    }
  }
}

// Landmarks older than the keyframe `oldest` are judged by what they did before.
void LateJudgement::JudgeKeyframe(KeyframeId id, KeyframeId oldest, std::span<const DynamicBox> boxes,
                                  const DynamicFilter& filter, Map* map) const {
  Keyframe* keyframe = map->keyframes().Find(id);
  if (keyframe == nullptr) return;
  std::vector<float> static_probability = keyframe->static_probability();
  filter.JudgeLate(boxes, keyframe->features(), &static_probability);
  keyframe->set_static_probability(std::move(static_probability));
  const std::vector<LandmarkId> landmarks = keyframe->landmarks();
  for (uint32_t i = 0; i < landmarks.size(); ++i) {
    if (!landmarks[i].IsValid() || keyframe->StaticProbability(i) >= kMinStaticProbability) continue;
    if (map->landmarks().At(landmarks[i]).created_by() >= oldest) map->EraseLandmark(landmarks[i]);
  }
}

}  // namespace dynamic_slam
