#include "dynamic_slam/tracking/pose_refiner.h"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {
namespace {

constexpr size_t kMaxKeypoints = 8'000'000;

// With so many times the inliers that it needs a pose is not in doubt.
constexpr double kNoDoubt = 2;

// A frame sees of the map what the next one sees. With every frame, crowd 22 errs by 0.0102 m, with every
// third by 0.0110, with keyframes only by 0.0125; the time grows with the square. On a road keyframes are
// nearer to each other than that, and frames between them made errors 12% larger.
constexpr int kViewEvery = 3;

// Of more than these some are left out: the adjustment has some 250 bytes for each. Half as many cost crowd
// 22 a tenth of the accuracy.
constexpr size_t kMostSightings = 300;

FrameView ViewOf(const Frame& frame) {
  std::vector<FrameView::Sighting> all;
  for (size_t i = 0; i < frame.landmarks.size(); ++i) {
    const Keypoint& keypoint = frame.features.keypoints[i];
    if (!frame.landmarks[i].IsValid()) continue;
    all.push_back({frame.landmarks[i],
                   {keypoint.x, keypoint.y},
                   keypoint.octave,
                   frame.StaticProbability(i),
                   {keypoint.raw_x, keypoint.raw_y}});
  }
  FrameView view{frame.timestamp_s, PartId(), frame.cam_from_world, {}};
  const size_t count = std::min(all.size(), kMostSightings);
  for (size_t i = 0; i < count; ++i) view.sightings.push_back(all[i * all.size() / count]);
  return view;
}

}  // namespace

PoseRefiner::PoseRefiner(const Camera& camera, const TrackerOptions& options, SharedMap* map)
    : map_(map), finder_(camera, options, map) {}

void PoseRefiner::Keep(const Frame& frame, int min_inliers) {
  if (keypoints_.size() > kMaxKeypoints) return;
  const size_t first = keypoints_.size();
  const std::vector<Keypoint> keypoints = FrameFinder::ReadKeypoints(frame);
  for (size_t i = 0; i < keypoints.size(); ++i) {
    const float p = frame.StaticProbability(i);
    if (p >= kMinStaticProbability) keypoints_.push_back({keypoints[i], p, frame.features.descriptors[i]});
  }
  frames_.push_back({frame.id, frame.timestamp_s, first, keypoints_.size() - first, min_inliers});
}

std::vector<AnchoredPose> PoseRefiner::Refine(std::span<const AnchoredPose> known,
                                              const std::function<bool()>& should_stop,
                                              std::vector<FrameView>* views, ViewsOf of) {
  DS_TRACE("refine");
  const KnownPoses before(known, map_);
  std::vector<Refined> refined(frames_.size());
  if (views != nullptr) AskForViews(of, &refined);
  for (const bool is_forward : {true, false}) Pass(is_forward, before, should_stop, &refined);
  std::vector<AnchoredPose> found;
  for (Refined& frame : refined) {
    if (!frame.pose.has_value()) continue;
    found.push_back(*frame.pose);
    if (!frame.has_view) continue;
    frame.view.part = map_->Read()->PartOf(frame.pose->reference);
    views->push_back(std::move(frame.view));
  }
  return found;
}

void PoseRefiner::AskForViews(ViewsOf of, std::vector<Refined>* refined) const {
  if (of == ViewsOf::kAll) {
    for (Refined& frame : *refined) frame.has_view = true;
    return;
  }
  std::set<double> keyframes;
  map_->Read()->keyframes().ForEach(
      [&](const Keyframe& keyframe) { keyframes.insert(keyframe.timestamp_s()); });
  int since = 0;
  for (size_t i = 0; i < frames_.size(); ++i) {
    const bool is_keyframe = keyframes.contains(frames_[i].timestamp_s);
    (*refined)[i].has_view = !is_keyframe && since + 1 >= kViewEvery;
    since = is_keyframe || (*refined)[i].has_view ? 0 : since + 1;
  }
}

void PoseRefiner::Pass(bool is_forward, const KnownPoses& known, const std::function<bool()>& should_stop,
                       std::vector<Refined>* refined) {
  KnownPoses passed = known;
  for (const KeptFrame& kept : frames_) passed.Forget(kept.timestamp_s);
  for (size_t k = 0; k < frames_.size(); ++k) {
    if (should_stop && should_stop()) return;
    const size_t i = is_forward ? k : frames_.size() - 1 - k;
    const KeptFrame& kept = frames_[i];
    const auto pose = known.by_stamp().find(kept.timestamp_s);
    if (pose == known.by_stamp().end()) continue;
    Refined& frame = (*refined)[i];
    if (frame.right_inliers < kNoDoubt * kept.min_inliers) {
      std::vector<KnownPoses::Guess> guesses = passed.Guesses(kept.timestamp_s);
      {
        const AnchoredPose& before = pose->second;
        const auto map = map_->Read();
        const PartId part = map->PartOf(before.reference);
        std::erase_if(guesses,
                      [&](const KnownPoses::Guess& guess) { return map->PartOf(guess.keyframe) != part; });
        if (is_forward) {
          guesses.push_back({map->ResolveKeyframe(before.reference).keyframe,
                             map->PoseFromReference(before.reference, before.cam_from_reference)});
        }
      }
      Track(kept, guesses, passed, &frame);
    }
    if (frame.pose.has_value()) passed.Add(*frame.pose);
  }
}

void PoseRefiner::Track(const KeptFrame& kept, std::span<const KnownPoses::Guess> guesses,
                        const KnownPoses& others, Refined* refined) {
  if (guesses.empty()) return;
  Frame frame = Restore(kept);
  for (const KnownPoses::Guess& guess : guesses) {
    if (finder_.Find(others, guess, KnownPoses::kSearches[0], kept.min_inliers, &frame) == 0) continue;
    const double right = finder_.localiser().pose_tracker().RightInliers();
    const std::optional<AnchoredPose> pose = finder_.PlausiblePose(others, &frame);
    if (!pose.has_value()) continue;
    if (right <= refined->right_inliers) return;
    refined->pose = pose;
    refined->right_inliers = right;
    if (refined->has_view) refined->view = ViewOf(frame);
    return;
  }
}

Frame PoseRefiner::Restore(const KeptFrame& kept) const {
  FeatureSet features;
  std::vector<float> static_probability;
  for (size_t i = kept.first; i < kept.first + kept.count; ++i) {
    const KeptKeypoint& keypoint = keypoints_[i];
    features.keypoints.push_back(keypoint.keypoint);
    features.descriptors.push_back(keypoint.descriptor);
    static_probability.push_back(keypoint.static_probability);
  }
  keypoints_.Release(kept.first, kept.count);
  return finder_.MakeFrame(kept.id, kept.timestamp_s, std::move(features), std::move(static_probability));
}

std::set<double> PoseRefiner::Refuted(std::span<const AnchoredPose> known,
                                      std::span<const AnchoredPose> found) const {
  std::set<double> kept;
  for (const KeptFrame& frame : frames_) kept.insert(frame.timestamp_s);
  const KnownPoses confirmed(found, map_);
  std::map<PartId, KnownPoses> of_parts;
  struct Row {  // of frames that nothing confirms, where they are: between the same that are
    std::vector<double> stamps;
    size_t out_of_reach = 0;
  };
  std::map<std::pair<PartId, double>, Row> rows;
  for (const AnchoredPose& pose : known) {
    if (!kept.contains(pose.timestamp_s) || confirmed.Contains(pose.timestamp_s)) continue;
    constexpr double kAnyTime = std::numeric_limits<double>::infinity();
    const PartId part = map_->Read()->PartOf(pose.reference);
    if (!of_parts.contains(part)) of_parts.emplace(part, confirmed.Within(part, -kAnyTime, kAnyTime));
    const KnownPoses& of_part = of_parts.at(part);
    Row& row = rows[{part, of_part.Between(pose.timestamp_s).first}];
    row.stamps.push_back(pose.timestamp_s);
    row.out_of_reach += !of_part.IsPlausible(pose);
  }
  std::set<double> refuted;
  for (const auto& [where, row] : rows) {
    if (2 * row.out_of_reach > row.stamps.size()) refuted.insert(row.stamps.begin(), row.stamps.end());
  }
  return refuted;
}

void PoseRefiner::GiveTo(Backfiller* backfiller, const std::set<double>& stamps) const {
  for (const KeptFrame& kept : frames_) {
    if (stamps.contains(kept.timestamp_s)) backfiller->Keep(Restore(kept), kept.min_inliers, false);
  }
}

void PoseRefiner::Clear() {
  frames_.clear();
  keypoints_.clear();
}

}  // namespace dynamic_slam
