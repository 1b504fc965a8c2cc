#include "dynamic_slam/tracking/reference_view.h"

#include <algorithm>
#include <utility>

#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {
namespace {

constexpr double kMatchRatio = 0.9;

// Views beside the outer two: they make the first map more exact, and tell motions apart.
constexpr size_t kMaxViewsBetween = 6;

double ScaleOf(const Keypoint& keypoint, const std::vector<float>& octave_scales) {
  return octave_scales[static_cast<size_t>(keypoint.octave)];
}

}  // namespace

ReferenceView::ReferenceView(const Frame& frame, const std::vector<float>& octave_scales) : frame_(frame) {
  views_.reference_timestamp_s = frame.timestamp_s;
  for (uint32_t i = 0; i < frame.features.size(); ++i) {
    const Keypoint& keypoint = frame.features.keypoints[i];
    views_.reference.push_back({i, frame.ReadPx(i), ScaleOf(keypoint, octave_scales), keypoint.raw_y});
    last_places_.emplace_back(keypoint.x, keypoint.y);
  }
}

std::vector<Match> ReferenceView::MatchWith(const Frame& frame, const InitializerOptions& options) {
  const FeatureSet& first = frame_.features;
  struct Taker {
    uint32_t reference = WindowMatch::kNone;
    int distance = 257;
  };
  std::vector<Taker> takers(frame.features.size());
  // What may move takes no part (section 4.3).
  std::vector<uint8_t> moves(frame.features.size());
  for (size_t i = 0; i < moves.size(); ++i) moves[i] = frame.StaticProbability(i) < kMinStaticProbability;
  for (uint32_t i = 0; i < first.size(); ++i) {
    const int octave = first.keypoints[i].octave;
    if (octave > options.max_octave || frame_.MovesForSure(i)) continue;
    const SearchWindow window{last_places_[i].x(), last_places_[i].y(),
                              static_cast<float>(options.search_radius_px), std::max(0, octave - 1),
                              std::min(octave + 1, options.max_octave)};
    const WindowMatch match = FindInWindow(frame.features, frame.grid, window, first.descriptors[i], moves);
    if (match.distance > kStrictDistance || match.distance > kMatchRatio * match.second_distance) continue;
    if (match.distance < takers[match.keypoint].distance) takers[match.keypoint] = {i, match.distance};
  }
  std::vector<Match> matches;
  RotationConsistency rotation;
  for (uint32_t i = 0; i < takers.size(); ++i) {
    if (takers[i].reference == WindowMatch::kNone) continue;
    matches.push_back({takers[i].reference, i, takers[i].distance});
    rotation.Add(first.keypoints[takers[i].reference].angle_rad, frame.features.keypoints[i].angle_rad);
  }
  const std::vector<uint8_t>& keep = rotation.Judge();
  size_t kept = 0;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (keep[i] == 0) continue;
    matches[kept++] = matches[i];
    const Keypoint& keypoint = frame.features.keypoints[matches[i].second];
    last_places_[matches[i].first] = {keypoint.x, keypoint.y};
  }
  matches.resize(kept);
  most_matches_ = std::max(most_matches_, kept);
  return matches;
}

void ReferenceView::AddView(const Frame& frame, const std::vector<Match>& matches,
                            const std::vector<float>& octave_scales) {
  if (!views_.last.sightings.empty()) views_.between.push_back(std::move(views_.last));
  // Of too many views every second one is enough.
  if (views_.between.size() > kMaxViewsBetween) {
    for (size_t i = 0; 2 * i + 1 < views_.between.size(); ++i)
      views_.between[i] = std::move(views_.between[2 * i + 1]);
    views_.between.resize(views_.between.size() / 2);
  }
  views_.last = {frame.timestamp_s, {}};
  for (const Match& match : matches) {
    const Keypoint& keypoint = frame.features.keypoints[match.second];
    views_.last.sightings.push_back(
        {match.first, frame.ReadPx(match.second), ScaleOf(keypoint, octave_scales), keypoint.raw_y});
  }
}

}  // namespace dynamic_slam
