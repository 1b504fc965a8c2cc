#include "dynamic_slam/tracking/initializer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {
namespace {

constexpr double kMatchRatio = 0.9;

// Views beside the outer two: they make the first map more exact, and tell motions apart.
constexpr size_t kMaxViewsBetween = 6;

// Standard errors by which the better of two motions must be better. Errors of one scene are not independent,
// so more than the usual three; and max_cost_ratio guards against what no such test sees, a rolling shutter
// that bends all.
constexpr double kMinPreference = 5.0;

// The same, when the errors of the two are too alike to be certain. Above what a rolling shutter was seen to
// do.
constexpr double kMinTryPreference = 8.0;

}  // namespace

Initializer::Initializer(const Camera& camera, const InitializerOptions& options,
                         std::vector<float> octave_scales)
    : camera_(camera), options_(options), octave_scales_(std::move(octave_scales)) {
  Reset();
}

void Initializer::Reset() {
  reference_.reset();
  views_ = {};
  reason_ = "waiting for the first image";
}

void Initializer::StartFrom(const Frame& frame) {
  most_matches_ = 0;
  reference_ = frame;
  views_ = {};
  for (uint32_t i = 0; i < frame.features.size(); ++i) {
    const Keypoint& keypoint = frame.features.keypoints[i];
    views_.reference.push_back({i, {keypoint.x, keypoint.y}, ScaleOf(keypoint)});
  }
  last_places_.resize(frame.features.size());
  for (size_t i = 0; i < last_places_.size(); ++i) {
    last_places_[i] = {frame.features.keypoints[i].x, frame.features.keypoints[i].y};
  }
}

std::vector<Match> Initializer::MatchWithReference(const Frame& frame) {
  const FeatureSet& first = reference_->features;
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
    if (octave > options_.max_octave || reference_->MovesForSure(i)) continue;
    const SearchWindow window{last_places_[i].x(), last_places_[i].y(),
                              static_cast<float>(options_.search_radius_px), std::max(0, octave - 1),
                              std::min(octave + 1, options_.max_octave)};
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
  return matches;
}

std::optional<InitialProposal> Initializer::Propose(const Frame& frame, Random& random) {
  if (static_cast<int>(frame.features.size()) < options_.min_matches) {
    reason_ = fmt::format("initialising: {} keypoints < {}; point the camera at something with texture",
                          frame.features.size(), options_.min_matches);
    return std::nullopt;
  }
  if (!reference_.has_value()) {
    StartFrom(frame);
    reason_ = "initialising: waiting for a second view";
    return std::nullopt;
  }
  std::vector<Match> matches = MatchWithReference(frame);
  most_matches_ = std::max(most_matches_, matches.size());
  const double min_matches = std::max(static_cast<double>(options_.min_matches),
                                      options_.min_match_ratio * static_cast<double>(most_matches_));
  if (static_cast<double>(matches.size()) < min_matches) {
    reason_ =
        fmt::format("initialising: {} matches < {:.0f} with the first view; starting again from this one",
                    matches.size(), min_matches);
    StartFrom(frame);
    return std::nullopt;
  }
  AddView(frame, matches);
  std::vector<Eigen::Vector2d> first_px, second_px;
  for (const Sighting& sighting : views_.last.sightings) {
    first_px.push_back(views_.reference[sighting.reference_keypoint].ideal_px);
    second_px.push_back(sighting.ideal_px);
  }
  const TwoViewOptions limits = Limits(frame);
  const TwoViewResult motion = EstimateTwoView(camera_, first_px, second_px, limits, random);
  if (!motion.Succeeded() && motion.failure != TwoViewFailure::kAmbiguous) {
    reason_ = "initialising: " + Explain(motion);
    return std::nullopt;
  }
  std::optional<InitialProposal> proposal = ChooseStructure(motion, limits.min_points);
  if (!proposal.has_value()) return std::nullopt;
  reason_ = fmt::format("initialised{}: {} points, parallax {:.1f} deg, {} views",
                        proposal->is_certain ? "" : " for the time being", proposal->structure.points,
                        motion.parallax_deg, views_.between.size() + 2);
  proposal->matches = std::move(matches);
  return proposal;
}

void Initializer::AddView(const Frame& frame, const std::vector<Match>& matches) {
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
    views_.last.sightings.push_back({match.first, {keypoint.x, keypoint.y}, ScaleOf(keypoint)});
  }
}

TwoViewOptions Initializer::Limits(const Frame& frame) const {
  TwoViewOptions limits = options_.two_view;
  const auto movers = std::count_if(frame.static_probability.begin(), frame.static_probability.end(),
                                    [](float p) { return p < kMinStaticProbability; });
  const double share = static_cast<double>(movers) / static_cast<double>(frame.features.size());
  // Half of a view is enough to hide what tells two motions apart.
  const double full = std::min(2 * share, 1.0);
  const auto raise = [full](double from, double to) { return from + full * std::max(to - from, 0.0); };
  limits.min_parallax_deg = raise(limits.min_parallax_deg, options_.movers_min_parallax_deg);
  limits.min_points = static_cast<int>(raise(limits.min_points, options_.movers_min_points));
  return limits;
}

std::optional<InitialProposal> Initializer::ChooseStructure(const TwoViewResult& result, int min_points) {
  if (views_.between.empty()) {
    reason_ = "initialising: waiting for a third view, to be sure";
    return std::nullopt;
  }
  std::vector<InitialStructure> structures{RefineMotion(camera_, result.motion, views_)};
  for (const TwoViewMotion& rival : result.rivals) structures.push_back(RefineMotion(camera_, rival, views_));
  std::stable_sort(
      structures.begin(), structures.end(),
      [](const InitialStructure& a, const InitialStructure& b) { return a.MeanCost() < b.MeanCost(); });
  InitialStructure& best = structures.front();
  double cost_ratio = 0, preference = std::numeric_limits<double>::max();
  for (size_t i = 1; i < structures.size(); ++i) {
    cost_ratio = std::max(cost_ratio, best.MeanCost() / structures[i].MeanCost());
    preference = std::min(preference, Preference(best, structures[i]));
  }
  const bool is_certain = preference > kMinPreference && cost_ratio < options_.max_cost_ratio;
  if (!is_certain && preference < kMinTryPreference) {
    reason_ = fmt::format(
        "initialising: two motions fit {} views, errors {:.2f} of each other (certain below {:.2f}), "
        "{:.1f} standard errors apart < {:.1f}; show something out of the plane",
        views_.between.size() + 2, cost_ratio, options_.max_cost_ratio, preference, kMinTryPreference);
    return std::nullopt;
  }
  if (!best.usable) {
    reason_ = "initialising: the first bundle adjustment failed; trying the next image";
    return std::nullopt;
  }
  if (best.points < min_points) {
    reason_ = fmt::format("initialising: {} points survive the first bundle adjustment < {}", best.points,
                          min_points);
    return std::nullopt;
  }
  return InitialProposal{std::move(best), {}, is_certain};
}

std::vector<AnchoredPose> Initializer::BuildMap(const InitialProposal& proposal, Frame* frame, Map* map) {
  const InitialStructure& structure = proposal.structure;
  const std::vector<Match>& matches = proposal.matches;
  std::vector<double> depths;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (structure.is_good[i] != 0) depths.push_back(structure.points_in_reference[i].z());
  }
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  const double scale = 1.0 / *middle;

  reference_->cam_from_world = Rigid3();
  reference_->ClearLandmarks();
  frame->cam_from_world = structure.last_from_reference;
  frame->cam_from_world.translation *= scale;
  frame->ClearLandmarks();
  const PartId part = map->BeginPart();
  const KeyframeId first_id = InsertKeyframe(*reference_, map, part);
  const KeyframeId second_id = InsertKeyframe(*frame, map, part);
  for (size_t i = 0; i < matches.size(); ++i) {
    if (structure.is_good[i] == 0) continue;
    const Eigen::Vector3d position = scale * structure.points_in_reference[i];
    const LandmarkId id = map->AddLandmark(position, second_id).id();
    map->Link(first_id, matches[i].first, id);
    map->Link(second_id, matches[i].second, id);
    map->RefreshLandmark(id);
    frame->landmarks[matches[i].second] = id;
    frame->points[matches[i].second] = position;
  }
  frame->reference = second_id;
  frame->cam_from_reference = Rigid3();

  std::vector<AnchoredPose> earlier{{reference_->timestamp_s, first_id, Rigid3()}};
  for (size_t i = 0; i < views_.between.size(); ++i) {
    if (!structure.between_from_reference[i].has_value()) continue;
    Rigid3 pose = *structure.between_from_reference[i];
    pose.translation *= scale;
    earlier.push_back({views_.between[i].timestamp_s, first_id, pose});
  }
  return earlier;
}

}  // namespace dynamic_slam
