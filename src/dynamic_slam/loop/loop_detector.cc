#include "dynamic_slam/loop/loop_detector.h"

#include <algorithm>
#include <limits>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/features/matcher.h"
#include "dynamic_slam/geometry/chi2.h"
#include "dynamic_slam/loop/part_matches.h"

namespace dynamic_slam {
namespace {

constexpr int kMatchDistance = (kStrictDistance + kLooseDistance) / 2;
constexpr double kMatchRatio = 0.9;

// Between two parts: viewpoints from which a similarity is looked for, samples drawn at most, enough when a
// tenth of the matches is right, and viewpoints from which it is verified.
constexpr size_t kViewpoints = 20, kVerified = 100;
constexpr int kSamplesAcross = 5000;
// Landmarks that must then be found by projection: beside those that are matched before, so fewer than of a
// place that two keyframes know.
constexpr int kMinInliersAcross = 25;

// Keyframes about the candidate whose landmarks make the old place.
constexpr size_t kPlaceKeyframes = 15;
// The same, to begin with: more of them have more that looks alike by chance.
constexpr size_t kMatchedKeyframes = 5;

// Neighbours of the keyframe that are asked for confirmation.
constexpr size_t kNeighbours = 5;

// About where the similarity of a few matches puts a landmark, and about where that of many does.
constexpr double kFirstRadiusPx = 10, kSecondRadiusPx = 5;

// About a pixel, in which keypoints tell who is to be seen there: two cells of their grid.
constexpr float kHidingRadiusPx = 2 * KeypointGrid::kCellSizePx;

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<LandmarkId> LandmarksAbout(const Map& map, const Keyframe& keyframe, size_t neighbours) {
  std::vector<bool> is_taken(map.landmarks().CreatedCount(), false);
  std::vector<LandmarkId> landmarks;
  const auto add = [&](const Keyframe& from) {
    for (const LandmarkId id : from.landmarks()) {
      if (!id.IsValid() || is_taken[id.value()]) continue;
      is_taken[id.value()] = true;
      landmarks.push_back(id);
    }
  };
  add(keyframe);
  for (const CovisibleKeyframe& other : keyframe.BestCovisible(neighbours)) {
    add(map.keyframes().At(other.id));
  }
  return landmarks;
}

int UsableKeypoints(const Keyframe& keyframe) {
  int usable = 0;
  for (uint32_t i = 0; i < keyframe.features().size(); ++i) {
    usable += keyframe.StaticProbability(i) >= kMinStaticProbability;
  }
  return usable;
}

// Whether somebody who moves stands before what would be at the pixel: most of the keypoints about it are
// theirs.
bool IsHidden(const Keyframe& keyframe, const Eigen::Vector2d& px) {
  int movers = 0, all = 0;
  keyframe.grid().ForEachInWindow(static_cast<float>(px.x()), static_cast<float>(px.y()), kHidingRadiusPx, 0,
                                  std::numeric_limits<int>::max(), [&](uint32_t i) {
                                    ++all;
                                    movers += keyframe.StaticProbability(i) < kMinStaticProbability;
                                  });
  return 2 * movers > all;
}

LoopAttempt Attempt(const Map& map, const Keyframe& keyframe, KeyframeId candidate) {
  LoopAttempt attempt;
  attempt.keyframe = keyframe.id();
  attempt.candidate = candidate;
  attempt.timestamp_s = keyframe.timestamp_s();
  attempt.candidate_timestamp_s = map.keyframes().At(candidate).timestamp_s();
  return attempt;
}

LoopAttempt Attempt(const Map& map, const PartMatches::Viewpoint& viewpoint) {
  return Attempt(map, map.keyframes().At(viewpoint.here), viewpoint.there);
}

Eigen::Vector2d Pixel(const Keypoint& keypoint) { return {keypoint.x, keypoint.y}; }

}  // namespace

Sim3 FromKeyframe(const Keyframe& other, const Keyframe& keyframe) {
  return ToSim3(other.cam_from_world() * keyframe.cam_from_world().Inverse());
}

bool HasDrifted(const Keyframe& keyframe, const Keyframe& candidate, double drift_px,
                const LoopOptions& options) {
  return keyframe.part() != candidate.part() || drift_px >= options.min_drift_px;
}

std::vector<LandmarkId> LandmarksOfPlace(const Map& map, const Keyframe& keyframe) {
  return LandmarksAbout(map, keyframe, kPlaceKeyframes);
}

LoopDetector::LoopDetector(const Camera& camera, const LoopOptions& options,
                           const std::vector<float>& octave_scales, uint64_t seed)
    : camera_(camera), options_(options), projector_(camera, octave_scales), seed_(seed) {}

std::optional<Loop> LoopDetector::Detect(KeyframeId keyframe_id, uint32_t epoch, const SharedMap& shared_map,
                                         std::vector<LoopAttempt>* attempts) {
  DS_TRACE("loop/detect");
  std::vector<Candidate> candidates;
  uint32_t revision = 0;
  {
    const auto map = shared_map.Read();
    const Keyframe* keyframe = map->epoch() == epoch ? map->keyframes().Find(keyframe_id) : nullptr;
    if (keyframe == nullptr) return std::nullopt;
    revision = map->revision();
    candidates = Candidates(*map, *keyframe);
  }
  for (Candidate& candidate : candidates) {
    LoopAttempt& attempt = candidate.attempt;
    std::optional<Loop> loop;
    Random random(seed_ + keyframe_id.value());
    if (attempt.matches < options_.min_matches) {
      attempt.reason = fmt::format("{} matches < {}", attempt.matches, options_.min_matches);
    } else if (const Sim3Estimate estimate = EstimateSim3(camera_, candidate.matches, options_.sim3, random);
               !estimate.success) {
      attempt.sim3_inliers = estimate.inliers;
      attempt.reason = TooFewFit(estimate.inliers);
    } else {
      attempt.sim3_inliers = estimate.inliers;
      const auto map = shared_map.Read();
      const bool is_same = map->epoch() == epoch && map->revision() == revision;
      const Keyframe* keyframe = is_same ? map->keyframes().Find(keyframe_id) : nullptr;
      const Keyframe* place = is_same ? map->keyframes().Find(attempt.candidate) : nullptr;
      if (keyframe == nullptr || place == nullptr) {
        attempt.reason = "the map has changed meanwhile";
      } else {
        loop = Verify(*map, *keyframe, *place, estimate.first_from_second,
                      {options_.min_inliers, options_.min_found_share}, &attempt);
      }
    }
    attempts->push_back(attempt);
    if (loop.has_value() && attempt.reason.empty()) return loop;
  }
  return std::nullopt;
}

// What looks alike from one keyframe after another and fits one similarity, ten landmarks and more, is no
// ground that looks alike everywhere: of two places that are not one, four at most did, in some 160 tries. So
// no share of the landmarks must be found, which is small where people stood in the way.
std::optional<Loop> LoopDetector::DetectAcross(PartId here, PartId there, const SharedMap& shared_map,
                                               const std::function<bool()>& should_stop,
                                               std::vector<LoopAttempt>* attempts) {
  DS_TRACE("loop/detect_across");
  const auto map = shared_map.Read();
  const PartMatches matches(camera_, *map, here, there);
  const std::span<const PartMatches::Viewpoint> viewpoints = matches.viewpoints();
  if (viewpoints.empty()) return std::nullopt;

  Sim3Options options = options_.sim3;
  options.max_ransac_iterations = std::max(options.max_ransac_iterations, kSamplesAcross);
  Random random(seed_);
  LoopAttempt best = Attempt(*map, viewpoints[0]);
  Sim3 here_from_there;
  for (const PartMatches::Viewpoint& viewpoint : viewpoints.first(std::min(kViewpoints, viewpoints.size()))) {
    if (should_stop && should_stop()) return std::nullopt;
    const std::vector<Sim3Match> seen = matches.From(viewpoint);
    const Sim3Estimate estimate = EstimateSim3(camera_, seen, options, random);
    if (estimate.inliers <= best.sim3_inliers) continue;
    best = Attempt(*map, viewpoint);
    best.matches = static_cast<int>(seen.size());
    best.sim3_inliers = estimate.inliers;
    here_from_there = ToSim3(map->keyframes().At(viewpoint.here).cam_from_world()).Inverse() *
                      estimate.first_from_second *
                      ToSim3(map->keyframes().At(viewpoint.there).cam_from_world());
  }
  if (best.sim3_inliers < options.min_inliers) {
    best.reason = TooFewFit(best.sim3_inliers);
    attempts->push_back(best);
    return std::nullopt;
  }

  // Who knows the other part best need not be who sees most of it.
  const int known = best.matches;
  std::optional<Loop> loop;
  for (const PartMatches::Viewpoint& viewpoint : viewpoints.first(std::min(kVerified, viewpoints.size()))) {
    if (should_stop && should_stop()) return std::nullopt;
    const Keyframe& keyframe = map->keyframes().At(viewpoint.here);
    const Keyframe& candidate = map->keyframes().At(viewpoint.there);
    const Sim3 similarity =
        ToSim3(keyframe.cam_from_world()) * here_from_there * ToSim3(candidate.cam_from_world()).Inverse();
    LoopAttempt attempt = Attempt(*map, viewpoint);
    attempt.matches = known;
    Loop verified = Verify(*map, keyframe, candidate, similarity, {kMinInliersAcross, 0}, &attempt);
    const bool is_loop = attempt.reason.empty();
    if (std::pair(is_loop, attempt.inliers) < std::pair(loop.has_value(), best.inliers)) continue;
    best = attempt;
    if (is_loop) loop = std::move(verified);
  }
  attempts->push_back(best);
  return loop;
}

std::vector<LoopDetector::Candidate> LoopDetector::Candidates(const Map& map,
                                                              const Keyframe& keyframe) const {
  const std::vector<PlaceMatch> places = map.places().Query(map.places().WordsOf(keyframe.id()));
  double best_score = 0;
  std::vector<Candidate> candidates;
  for (const PlaceMatch& place : places) {
    if (place.keyframe == keyframe.id()) continue;
    if (keyframe.WeightOf(place.keyframe) >= options_.covisible_weight) {
      best_score = std::max(best_score, place.score);
      continue;
    }
    // A younger keyframe finds this one, when its turn comes.
    if (keyframe.id() < place.keyframe) continue;
    if (static_cast<int>(candidates.size()) == options_.max_candidates) continue;
    Candidate candidate;
    candidate.attempt = Attempt(map, keyframe, place.keyframe);
    candidate.attempt.score = place.score;
    candidates.push_back(candidate);
  }
  std::erase_if(candidates, [&](const Candidate& candidate) {
    return candidate.attempt.score < options_.min_score_ratio * best_score;
  });
  for (Candidate& candidate : candidates) {
    candidate.matches = MatchLandmarks(map, keyframe, map.keyframes().At(candidate.attempt.candidate));
    candidate.attempt.matches = static_cast<int>(candidate.matches.size());
  }
  return candidates;
}

std::string LoopDetector::TooFewFit(int inliers) const {
  return fmt::format("{} matches fit one similarity < {}", inliers, options_.sim3.min_inliers);
}

std::vector<Sim3Match> LoopDetector::MatchLandmarks(const Map& map, const Keyframe& keyframe,
                                                    const Keyframe& candidate) const {
  std::vector<uint32_t> own;
  keyframe.ForEachLandmark([&](uint32_t keypoint, LandmarkId) { own.push_back(keypoint); });
  // The landmarks about the candidate, as if they were one image.
  const std::vector<LandmarkId> landmarks = LandmarksAbout(map, candidate, kMatchedKeyframes);
  FeatureSet place;
  std::vector<uint32_t> all;
  for (const LandmarkId id : landmarks) {
    const Landmark& landmark = map.landmarks().At(id);
    const Observation& seen = landmark.observations().front();
    all.push_back(static_cast<uint32_t>(all.size()));
    place.keypoints.push_back(map.keyframes().At(seen.keyframe).keypoint(seen.keypoint));
    place.descriptors.push_back(landmark.descriptor());
  }
  const std::vector<Match> found =
      MatchMutual(keyframe.features(), own, place, all, kMatchDistance, kMatchRatio);
  RotationConsistency rotation;
  for (const Match& match : found) {
    rotation.Add(keyframe.keypoint(match.first).angle_rad, place.keypoints[match.second].angle_rad);
  }
  const std::vector<uint8_t>& keep = rotation.Judge();
  std::vector<Sim3Match> matches;
  for (size_t i = 0; i < found.size(); ++i) {
    if (keep[i] == 0 || keyframe.landmarks()[found[i].first] == landmarks[found[i].second]) continue;
    AddMatch(map, keyframe, candidate, found[i].first, landmarks[found[i].second], &matches);
  }
  return matches;
}

// Where the candidate would see the landmark stands for where it does: not all are in its image.
void LoopDetector::AddMatch(const Map& map, const Keyframe& keyframe, const Keyframe& candidate,
                            uint32_t keypoint_index, LandmarkId landmark,
                            std::vector<Sim3Match>* matches) const {
  const Eigen::Vector3d x = candidate.cam_from_world() * map.landmarks().At(landmark).position();
  if (x.z() <= 0) return;
  const Keypoint& keypoint = keyframe.keypoint(keypoint_index);
  const double sigma_px = map.octave_scales()[static_cast<size_t>(keypoint.octave)];
  const Landmark& own = map.landmarks().At(keyframe.landmarks()[keypoint_index]);
  matches->push_back({keyframe.cam_from_world() * own.position(), x, Pixel(keypoint), camera_.Project(x),
                      sigma_px, sigma_px});
}

Loop LoopDetector::Verify(const Map& map, const Keyframe& keyframe, const Keyframe& candidate,
                          const Sim3& similarity, const Needed& needed, LoopAttempt* attempt) {
  Loop loop{keyframe.id(), candidate.id(), similarity, {}, LandmarksOfPlace(map, candidate), true};
  const Sim3 candidate_from_world = ToSim3(candidate.cam_from_world());
  for (const double radius_px : {kFirstRadiusPx, kSecondRadiusPx}) {
    const Rigid3 pose = ToRigid3(loop.keyframe_from_candidate * candidate_from_world);
    loop.links = FindLandmarks(map, keyframe, pose, loop.landmarks, radius_px, &attempt->visible);
    std::vector<Sim3Match> matches;
    for (const Loop::Link& link : loop.links) {
      const LandmarkId own = keyframe.landmarks()[link.keypoint];
      if (own.IsValid() && own != link.landmark) {
        AddMatch(map, keyframe, candidate, link.keypoint, link.landmark, &matches);
      }
    }
    const std::vector<Sim3Sighting> sightings =
        NeighboursSightings(map, keyframe, candidate, loop, radius_px);
    const Sim3Estimate refined =
        RefineSim3(camera_, matches, options_.sim3, loop.keyframe_from_candidate, sightings);
    attempt->sim3_inliers = refined.inliers;
    if (!refined.success) {
      attempt->reason = fmt::format("{} of {} landmarks found by projection fit one similarity < {}",
                                    refined.inliers, loop.links.size(), options_.sim3.min_inliers);
      return loop;
    }
    loop.keyframe_from_candidate = refined.first_from_second;
  }

  const Sim3 keyframe_from_world = loop.keyframe_from_candidate * candidate_from_world;
  const Rigid3 pose = ToRigid3(keyframe_from_world);
  std::vector<double> drifts_px;
  size_t known = 0;
  std::erase_if(loop.links, [&](const Loop::Link& link) {
    const Keypoint& keypoint = keyframe.keypoint(link.keypoint);
    const double sigma_px = map.octave_scales()[static_cast<size_t>(keypoint.octave)];
    const Eigen::Vector3d& x_in_world = map.landmarks().At(link.landmark).position();
    const Eigen::Vector2d px = camera_.Project(pose * x_in_world);
    if ((px - Pixel(keypoint)).squaredNorm() > kChi2TwoDof * sigma_px * sigma_px) return true;
    known += keyframe.landmarks()[link.keypoint] == link.landmark;
    const Eigen::Vector3d by_map = keyframe.cam_from_world() * x_in_world;
    drifts_px.push_back(by_map.z() > 0 ? (camera_.Project(by_map) - px).norm() : camera_.width);
    return false;
  });
  attempt->inliers = static_cast<int>(loop.links.size());
  attempt->scale = loop.keyframe_from_candidate.scale;
  attempt->drift_px = Median(drifts_px);
  loop.has_drifted = HasDrifted(keyframe, candidate, attempt->drift_px, options_);
  if (attempt->inliers < needed.inliers) {
    attempt->reason = fmt::format("{} landmarks found < {}", attempt->inliers, needed.inliers);
    return loop;
  }
  // No image shows more landmarks than it has keypoints for them.
  attempt->visible = std::min(attempt->visible, UsableKeypoints(keyframe));
  if (attempt->inliers < needed.found_share * attempt->visible) {
    attempt->reason = fmt::format("{} of {} landmarks found that should be visible < {:.0f}%",
                                  attempt->inliers, attempt->visible, 100 * needed.found_share);
    return loop;
  }
  if (2 * known > loop.links.size()) {
    attempt->reason = fmt::format("{} of {} landmarks are known already", known, loop.links.size());
    return loop;
  }

  const std::vector<CovisibleKeyframe> neighbours = keyframe.BestCovisible(kNeighbours);
  for (const CovisibleKeyframe& other : neighbours) {
    const Keyframe& neighbour = map.keyframes().At(other.id);
    const Rigid3 there = ToRigid3(FromKeyframe(neighbour, keyframe) * keyframe_from_world);
    int visible = 0;
    const size_t found =
        FindLandmarks(map, neighbour, there, loop.landmarks, kSecondRadiusPx, &visible).size();
    attempt->confirming += static_cast<int>(found) >= options_.min_confirming_inliers;
  }
  if (attempt->confirming < options_.min_confirming_keyframes) {
    attempt->reason = fmt::format("{} of {} neighbours see the place too < {}", attempt->confirming,
                                  neighbours.size(), options_.min_confirming_keyframes);
  }
  return loop;
}

std::vector<Sim3Sighting> LoopDetector::NeighboursSightings(const Map& map, const Keyframe& keyframe,
                                                            const Keyframe& candidate, const Loop& loop,
                                                            double radius_px) {
  const Sim3 keyframe_from_world = loop.keyframe_from_candidate * ToSim3(candidate.cam_from_world());
  std::vector<Sim3Sighting> sightings;
  for (const CovisibleKeyframe& other : keyframe.BestCovisible(kNeighbours)) {
    const Keyframe& neighbour = map.keyframes().At(other.id);
    const Sim3 cam_from_keyframe = FromKeyframe(neighbour, keyframe);
    const Rigid3 there = ToRigid3(cam_from_keyframe * keyframe_from_world);
    int visible = 0;
    for (const Loop::Link& link : FindLandmarks(map, neighbour, there, loop.landmarks, radius_px, &visible)) {
      const Keypoint& keypoint = neighbour.keypoint(link.keypoint);
      sightings.push_back({ToRigid3(cam_from_keyframe),
                           candidate.cam_from_world() * map.landmarks().At(link.landmark).position(),
                           Pixel(keypoint), map.octave_scales()[static_cast<size_t>(keypoint.octave)]});
    }
  }
  return sightings;
}

std::vector<Loop::Link> LoopDetector::FindLandmarks(const Map& map, const Keyframe& keyframe,
                                                    const Rigid3& cam_from_world,
                                                    const std::vector<LandmarkId>& landmarks,
                                                    double radius_px, int* visible) {
  *visible = 0;
  std::vector<Loop::Link> links;
  std::vector<uint8_t> taken(keyframe.features().size(), 0);
  for (uint32_t i = 0; i < taken.size(); ++i)
    taken[i] = !(keyframe.StaticProbability(i) >= kMinStaticProbability);
  projector_.SetPose(cam_from_world);
  for (const LandmarkId id : landmarks) {
    const Landmark& landmark = map.landmarks().At(id);
    LandmarkProjection projection;
    if (!projector_.Project(landmark.position(), landmark.normal(), landmark.min_distance(),
                            landmark.max_distance(), &projection)) {
      continue;
    }
    if (IsHidden(keyframe, projection.px)) continue;
    ++*visible;
    const double scale = map.octave_scales()[static_cast<size_t>(projection.octave)];
    const SearchWindow window{static_cast<float>(projection.px.x()), static_cast<float>(projection.px.y()),
                              static_cast<float>(radius_px * scale), projection.octave - 1,
                              projection.octave + 1};
    const WindowMatch match =
        FindInWindow(keyframe.features(), keyframe.grid(), window, landmark.descriptor(), taken);
    if (match.distance > kMatchDistance) continue;
    taken[match.keypoint] = 1;
    links.push_back({match.keypoint, id});
  }
  return links;
}

}  // namespace dynamic_slam
