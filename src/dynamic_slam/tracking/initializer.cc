#include "dynamic_slam/tracking/initializer.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "dynamic_slam/map/static_evidence.h"

namespace dynamic_slam {
namespace {

// Standard errors by which the better of two motions must be better. Errors of one scene are not independent,
// so more than the usual three; and max_cost_ratio guards against what no such test sees, a rolling shutter
// that bends all.
constexpr double kMinPreference = 5.0;

// The same, when the errors of the two are too alike to be certain. Above what a rolling shutter was seen to
// do.
constexpr double kMinTryPreference = 8.0;

// A start's views are so many times the readout of a rolling shutter apart at least, so that what it does to
// an image is a fifth of what the camera's motion does between the views. Of 82 starts among people, 10 of 36
// with less erred by more than 5% of the path in their first second, the worst by 24%, and 6 of 46 with more,
// the worst by 8%.
constexpr double kMinReadouts = 5.0;

}  // namespace

Initializer::Initializer(const Camera& camera, const InitializerOptions& options,
                         std::vector<float> octave_scales)
    : camera_(camera), options_(options), octave_scales_(std::move(octave_scales)), shutter_(camera) {
  Reset();
}

void Initializer::Reset() {
  references_.clear();
  is_reviewing_ = false;
  reason_ = "waiting for the first image";
}

std::optional<InitialProposal> Initializer::Propose(const Frame& frame, Random& random, FrameId untold_from) {
  if (static_cast<int>(frame.features.size()) < options_.min_matches) {
    reason_ = fmt::format("initialising: {} keypoints < {}; point the camera at something with texture",
                          frame.features.size(), options_.min_matches);
    return std::nullopt;
  }
  if (references_.empty()) {
    references_.emplace_back(frame, octave_scales_);
    reason_ = "initialising: waiting for a second view";
    return std::nullopt;
  }
  std::vector<std::vector<Match>> matches = MatchReferences(frame);
  if (references_.empty()) {
    references_.emplace_back(frame, octave_scales_);
    is_reviewing_ = false;
    return std::nullopt;
  }
  // The oldest has seen the camera come farthest: what it lacks is told, if none has enough.
  std::string reason;
  for (size_t i = 0; i < references_.size(); ++i) {
    if (references_[i].frame().id >= untold_from) {
      reason_ = "initialising: waiting for the detector's answer about the first view";
      if (i == 0) reason = reason_;
      continue;
    }
    std::optional<InitialProposal> proposal = ProposeFrom(i, frame, std::move(matches[i]), random);
    if (proposal.has_value()) return proposal;
    if (i == 0) reason = reason_;
  }
  reason_ = reason;
  AddReferenceIfDue(frame);
  return std::nullopt;
}

// Forgets the references of which too little is left; the reason given for it counts when that was the last
// one.
std::vector<std::vector<Match>> Initializer::MatchReferences(const Frame& frame) {
  std::vector<std::vector<Match>> matches;
  size_t kept = 0;
  for (ReferenceView& reference : references_) {
    std::vector<Match> found = reference.MatchWith(frame, options_);
    const double needed = std::max(static_cast<double>(options_.min_matches),
                                   options_.min_match_ratio * static_cast<double>(reference.most_matches()));
    if (static_cast<double>(found.size()) < needed) {
      reason_ =
          fmt::format("initialising: {} matches < {:.0f} with the first view; starting again from this one",
                      found.size(), needed);
      continue;
    }
    reference.AddView(frame, found, octave_scales_);
    matches.push_back(std::move(found));
    if (&references_[kept] != &reference) references_[kept] = std::move(reference);
    ++kept;
  }
  references_.erase(references_.begin() + static_cast<std::ptrdiff_t>(kept), references_.end());
  return matches;
}

// Before the newest is out of sight, another one takes over; the older ones may still start first.
void Initializer::AddReferenceIfDue(const Frame& frame) {
  if (is_reviewing_ || references_.size() >= static_cast<size_t>(options_.max_references)) return;
  const ReferenceView& newest = references_.back();
  if (static_cast<double>(newest.views().last.sightings.size()) <
      options_.renewal_match_ratio * static_cast<double>(newest.most_matches())) {
    references_.emplace_back(frame, octave_scales_);
  }
}

std::optional<InitialProposal> Initializer::ProposeFrom(size_t index, const Frame& frame,
                                                        std::vector<Match> matches, Random& random) {
  const InitialViews& views = references_[index].views();
  std::vector<Eigen::Vector2d> first_px, second_px;
  for (const Sighting& sighting : views.last.sightings) {
    first_px.push_back(views.reference[sighting.reference_keypoint].ideal_px);
    second_px.push_back(sighting.ideal_px);
  }
  const TwoViewOptions limits = Limits(frame);
  const TwoViewResult motion = EstimateTwoView(camera_, first_px, second_px, limits, random);
  if (!motion.Succeeded() && motion.failure != TwoViewFailure::kAmbiguous) {
    reason_ = "initialising: " + Explain(motion);
    return std::nullopt;
  }
  std::optional<InitialProposal> proposal = ChooseStructure(motion, views, limits.min_points);
  if (!proposal.has_value()) return std::nullopt;
  const double span_s = views.last.timestamp_s - views.reference_timestamp_s;
  if (const double needed_s = kMinReadouts * camera_.readout_s; span_s < needed_s) {
    reason_ =
        fmt::format("initialising: {:.2f} s since the first view < {:.2f} s, as a rolling shutter bends both",
                    span_s, needed_s);
    return std::nullopt;
  }
  reason_ = fmt::format("initialised{}: {} points, parallax {:.1f} deg, {} views",
                        proposal->is_certain ? "" : " for the time being", proposal->structure.points,
                        motion.parallax_deg, views.between.size() + 2);
  proposal->matches = std::move(matches);
  proposal->reference = index;
  return proposal;
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

std::optional<InitialProposal> Initializer::ChooseStructure(const TwoViewResult& result,
                                                            const InitialViews& views, int min_points) {
  if (views.between.empty()) {
    reason_ = "initialising: waiting for a third view, to be sure";
    return std::nullopt;
  }
  std::vector<InitialStructure> structures{RefineMotion(camera_, result.motion, views)};
  for (const TwoViewMotion& rival : result.rivals) structures.push_back(RefineMotion(camera_, rival, views));
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
        views.between.size() + 2, cost_ratio, options_.max_cost_ratio, preference, kMinTryPreference);
    return std::nullopt;
  }
  if (best.usable && shutter_.IsRolling()) CorrectShutters(camera_, views, &best);
  if (!best.usable) {
    reason_ = "initialising: the first bundle adjustment failed; trying the next image";
    return std::nullopt;
  }
  if (best.points < min_points) {
    reason_ = fmt::format("initialising: {} points survive the first bundle adjustment < {}", best.points,
                          min_points);
    return std::nullopt;
  }
  return InitialProposal{std::move(best), {}, is_certain, 0};
}

// The keypoints of both views go to where the middle row's time has them.
void Initializer::MoveKeypoints(const InitialProposal& proposal, double scale, Frame* reference,
                                Frame* last) const {
  const InitialStructure& structure = proposal.structure;
  const auto correct = [&](std::optional<SteadyMotion> motion, const Rigid3& cam_from_reference,
                           uint32_t Match::*keypoint, Frame* frame) {
    if (!motion.has_value()) return;
    motion->linear_per_s *= scale;
    std::vector<double> inverse_depths(frame->features.size(), 1.0);  // the median depth is 1
    for (size_t i = 0; i < proposal.matches.size(); ++i) {
      if (structure.is_good[i] == 0) continue;
      const double depth = scale * (cam_from_reference * structure.points_in_reference[i]).z();
      if (depth > 0) inverse_depths[proposal.matches[i].*keypoint] = 1 / depth;
    }
    shutter_.Move(*motion, inverse_depths, frame);
  };
  correct(structure.reference_motion, Rigid3(), &Match::first, reference);
  correct(structure.last_motion, structure.last_from_reference, &Match::second, last);
}

std::vector<AnchoredPose> Initializer::BuildMap(const InitialProposal& proposal, Frame* frame, Map* map) {
  const InitialStructure& structure = proposal.structure;
  // While the start is uncertain, only its own reference is asked on.
  std::swap(references_.front(), references_[proposal.reference]);
  references_.erase(references_.begin() + 1, references_.end());
  is_reviewing_ = true;
  Frame& reference = *references_.front().mutable_frame();
  const InitialViews& views = references_.front().views();
  const std::vector<Match>& matches = proposal.matches;
  std::vector<double> depths;
  for (size_t i = 0; i < matches.size(); ++i) {
    if (structure.is_good[i] != 0) depths.push_back(structure.points_in_reference[i].z());
  }
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  const double scale = 1.0 / *middle;

  reference.cam_from_world = Rigid3();
  reference.ClearLandmarks();
  frame->cam_from_world = structure.last_from_reference;
  frame->cam_from_world.translation *= scale;
  frame->ClearLandmarks();
  MoveKeypoints(proposal, scale, &reference, frame);
  const PartId part = map->BeginPart();
  const KeyframeId first_id = InsertKeyframe(reference, map, part);
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

  std::vector<AnchoredPose> earlier{{reference.timestamp_s, first_id, Rigid3()}};
  for (size_t i = 0; i < views.between.size(); ++i) {
    if (!structure.between_from_reference[i].has_value()) continue;
    Rigid3 pose = *structure.between_from_reference[i];
    pose.translation *= scale;
    earlier.push_back({views.between[i].timestamp_s, first_id, pose});
  }
  return earlier;
}

}  // namespace dynamic_slam
