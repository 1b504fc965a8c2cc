#include "dynamic_slam/tracking/dynamic_filter.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/geometry/segment.h"
#include "dynamic_slam/map/static_evidence.h"
#include "dynamic_slam/semantics/point_motion.h"
#include "dynamic_slam/semantics/selective_tracking.h"
#include "dynamic_slam/tracking/rest_flow.h"

namespace dynamic_slam {
namespace {

// Nothing at rest is expected nearer than this part of the median depth.
constexpr double kNearestDepthRatio = 0.3;

// By so many sigmas an object must move differently from what is at rest for a motion to tell them apart.
constexpr double kApart = 3;

// Spread of the motions of an object's parts, over its own motion.
constexpr double kLimbs = 0.4;

// Share of wrong matches, which lie anywhere in the window of the search.
constexpr double kMismatchShare = 0.1;

// What one frame can tell at most, as errors of matches have longer tails than any model.
constexpr double kMostEvidence = 2;

// Of what is at rest nearly all looks so; of what moves some does by chance, as it stops or as windows are
// narrow.
constexpr double kFitsAtRest = 0.95, kFitsMoving = 0.35;

// Log-odds of being at rest of what does, or does not, look so.
double EvidenceOfRest(bool fits) {
  return fits ? std::log(kFitsAtRest / kFitsMoving) : std::log((1 - kFitsAtRest) / (1 - kFitsMoving));
}

// The motion of an object tells at most as much as 19 to 1. So it decides about what is parked as often as it
// drives, and never makes furniture of people, who stand still and go on.
const double kMostObjectEvidence = std::log(0.95 / 0.05);

// No class is surer than that.
constexpr double kMostProbability = 0.99;

// Bits of a word: so many that move are told apart, and all beyond them count as the last of these.
constexpr size_t kMaxToldApart = 32;

double Sigmoid(double log_odds) { return 1 / (1 + std::exp(-log_odds)); }

double Square(double x) { return x * x; }

// How a keypoint moved tells so much more of whether it is at rest.
void AddEvidence(double log_odds, float* motion_log_odds) {
  *motion_log_odds =
      std::clamp(*motion_log_odds + static_cast<float>(log_odds), -kMaxStaticLogOdds, kMaxStaticLogOdds);
}

}  // namespace

DynamicFilter::DynamicFilter(const Camera& camera, const DynamicOptions& options,
                             std::vector<float> octave_scales)
    : camera_(camera),
      options_(options),
      octave_scales_(std::move(octave_scales)),
      past_views_(camera, octave_scales_) {
  const double radius_px = options.method == "weights" ? kCornerRadius : 0;
  for (const float scale : octave_scales_) outlines_px_.push_back(radius_px * scale);
}

float DynamicFilter::Evidence(float static_probability, bool fits) const {
  if (!options_.landmark_odds || static_probability <= 0) return 0;
  // Frames that follow each other tell nearly the same.
  constexpr double kNews = 0.1;
  const double p = std::min<double>(static_probability, 1 - options_.missed_object);
  return static_cast<float>(kNews * (EvidenceOfRest(fits) + std::log(p / (1 - p))));
}

bool DynamicFilter::IsHidden(const Eigen::Vector2d& ideal_px) const {
  if (objects_.empty()) return false;
  const Eigen::Vector2d px = camera_.Distort(ideal_px);
  return std::any_of(objects_.begin(), objects_.end(), [&](const Object& object) {
    return object.IsMoving() && object.box.box.Contains(px.x(), px.y());
  });
}

void DynamicFilter::Reset() {
  objects_.clear();
  last_objects_.clear();
  boxes_.clear();
  past_views_.Clear();
}

bool DynamicFilter::OnlyBoxesMove(std::span<const PointMotion> motions) const {
  // A corner is found to a pixel; what moves by less than twice that cannot be told from what does not.
  constexpr double kStill_px = 1, kMoves_px = 2;
  std::vector<double> inside_px, outside_px;
  for (const PointMotion& motion : motions) {
    const bool is_inside = std::any_of(objects_.begin(), objects_.end(), [&](const Object& object) {
      return object.box.box.Contains(motion.to_px.x(), motion.to_px.y());
    });
    (is_inside ? inside_px : outside_px).push_back((motion.to_px - motion.from_px).norm());
  }
  if (inside_px.empty() || outside_px.empty() || Median(&outside_px) > kStill_px) return false;
  // Somebody moves, though others stand, and the box shows what is behind them too.
  const auto upper = inside_px.begin() + static_cast<std::ptrdiff_t>(inside_px.size() * 3 / 4);
  std::nth_element(inside_px.begin(), upper, inside_px.end());
  return *upper > kMoves_px;
}

float DynamicFilter::Combine(float prior, float motion_log_odds) const {
  return static_cast<float>(std::min(TrustInMatch(prior, motion_log_odds), 1 - options_.missed_object));
}

void DynamicFilter::CombineAll(Frame* frame) {
  const size_t n = by_boxes_.prior.size();
  frame->static_probability = by_boxes_.unmoved;
  chosen_.resize(n);
  size_t count = 0;
  for (uint32_t i = 0; i < n; ++i) {
    chosen_[count] = i;
    count += static_cast<size_t>(frame->motion_log_odds[i] != 0);
  }
  for (const uint32_t i : std::span(chosen_).first(count)) {
    frame->static_probability[i] = Combine(by_boxes_.prior[i], frame->motion_log_odds[i]);
  }
}

DynamicKeypoints DynamicFilter::Judge(std::span<const DynamicBox> boxes, const KeypointFlow& flow,
                                      const Frame& last, Frame* frame) {
  DS_TRACE("tracking/judge");
  const bool weights = options_.method == "weights";
  last_objects_.swap(objects_);
  objects_.clear();
  boxes_.clear();
  if (options_.method != "none") {
    for (const DynamicBox& box : boxes) {
      if (!box.is_dynamic) continue;
      const double p = std::min(box.probability, kMostProbability);
      const auto before = std::find_if(last_objects_.begin(), last_objects_.end(), [&](const Object& object) {
        return object.box.track_id == box.track_id;
      });
      Object object{.box = box, .margin_px = MarginOf(box.box), .witnesses = WitnessesOf(box.box)};
      if (before != last_objects_.end()) {
        object.motion_log_odds = before->motion_log_odds;
        object.shifts = before->shifts;
      }
      if (weights) object.moves = Sigmoid(std::log(p / (1 - p)) + object.motion_log_odds);
      objects_.push_back(object);
      boxes_.push_back(box.box);
    }
  }
  const size_t n = frame->features.size();
  frame->static_probability.assign(n, 1.0f);
  frame->motion_log_odds.assign(n, 0.0f);
  if (objects_.empty()) {
    // Nothing is known that could move.
    DynamicKeypoints counts;
    counts.outside = static_cast<int>(n);
    return counts;
  }
  if (weights && options_.motion) {
    for (const uint32_t i : flow.followed()) {
      frame->motion_log_odds[i] = last.motion_log_odds[flow.last_keypoints()[i]];
    }
    if (flow.IsOfWitnesses()) ShareInCells(frame->grid, flow.last_keypoints(), frame->motion_log_odds);
  }
  JudgeByBoxes(objects_, frame->features, &by_boxes_);
  if (weights) {
    CombineAll(frame);
  } else {
    for (size_t i = 0; i < n; ++i) frame->static_probability[i] = by_boxes_.in_box[i] != 0 ? 0.0f : 1.0f;
  }
  if (options_.method == "paper") JudgeByDisplacement(flow, last, frame);
  DynamicKeypoints counts;
  for (size_t i = 0; i < n; ++i) {
    const int in_box = by_boxes_.in_box[i] != 0;
    counts.outside += 1 - in_box;
    counts.kept += in_box & static_cast<int>(frame->static_probability[i] >= kMinStaticProbability);
  }
  counts.culled = static_cast<int>(n) - counts.outside - counts.kept;
  return counts;
}

float DynamicFilter::Prior(double at_rest) const {
  return static_cast<float>(std::clamp(at_rest, options_.missed_object, 1 - options_.missed_object));
}

void DynamicFilter::JudgeLate(std::span<const DynamicBox> boxes, const FeatureSet& features,
                              std::vector<float>* static_probability) const {
  if (options_.method == "none") return;
  std::vector<Object> objects;
  for (const DynamicBox& box : boxes) {
    if (!box.is_dynamic) continue;
    objects.push_back(
        {.box = box, .margin_px = MarginOf(box.box), .moves = std::min(box.probability, kMostProbability)});
  }
  if (objects.empty()) return;
  static_probability->resize(features.size(), 1.0f);
  ByBoxes by_boxes;
  JudgeByBoxes(objects, features, &by_boxes);
  for (size_t i = 0; i < features.size(); ++i) {
    if (by_boxes.in_box[i] == 0) continue;
    float& p = (*static_probability)[i];
    p = options_.method == "weights" ? std::min(p, by_boxes.prior[i]) : 0;
  }
}

double DynamicFilter::MarginOf(const Box& box) const {
  return options_.method == "weights" ? options_.margin_ratio * std::sqrt(box.Area()) : 0;
}

// A point in a box belongs to the object with object_share, else to what is behind; in several boxes to one
// of these objects, each as likely as the other. However many overlap, motion can still overrule them.
float DynamicFilter::PriorIn(uint32_t boxes, std::span<const Object* const> objects) const {
  if (boxes == 0) return Prior(1);
  double belongs_to_none = 1, sum_moves = 0;
  for (uint32_t left = boxes; left != 0; left &= left - 1) {
    belongs_to_none *= 1 - options_.object_share;
    sum_moves += objects[static_cast<size_t>(std::countr_zero(left))]->moves;
  }
  return Prior(1 - (1 - belongs_to_none) * sum_moves / std::popcount(boxes));
}

void DynamicFilter::JudgeByBoxes(std::span<const Object> objects, const FeatureSet& features,
                                 ByBoxes* result) const {
  result->marks.Begin(features);
  std::array<const Object*, kMaxToldApart> movers{};
  size_t count = 0;
  for (const Object& object : objects) {
    if (!object.IsMoving()) continue;
    const size_t k = std::min(count++, kMaxToldApart - 1);
    if (movers[k] == nullptr) movers[k] = &object;
    result->marks.Mark(object.box.box, object.margin_px, outlines_px_, uint32_t{1} << k);
  }
  // Thousands of keypoints are in a few sets of boxes.
  struct InBoxes {
    uint32_t boxes = 0, in_box = 0;
    float prior = 0, unmoved = 0;
  };
  constexpr int kSlotBits = 6;
  std::array<InBoxes, 1 << kSlotBits> known;
  known.fill({0, 0, Prior(1), Combine(Prior(1), 0)});
  const size_t n = features.size();
  result->in_box.resize(n);
  result->prior.resize(n);
  result->unmoved.resize(n);
  for (size_t i = 0; i < n; ++i) {
    const uint32_t boxes = result->marks.bits()[i];
    InBoxes& slot = known[boxes * 0x9e3779b1u >> (32 - kSlotBits)];  // Fibonacci hashing
    if (slot.boxes != boxes) {
      slot = {boxes, 0, PriorIn(boxes, movers), 0};
      slot.unmoved = Combine(slot.prior, 0);
      for (uint32_t left = boxes; left != 0; left &= left - 1)
        slot.in_box |= movers[static_cast<size_t>(std::countr_zero(left))]->witnesses;
    }
    result->in_box[i] = slot.in_box;
    result->prior[i] = slot.prior;
    result->unmoved[i] = slot.unmoved;
  }
}

// Algorithm 2.
void DynamicFilter::JudgeByDisplacement(const KeypointFlow& flow, const Frame& last, Frame* frame) const {
  const size_t n = frame->features.size();
  std::vector<Eigen::Vector2d> positions(n);
  std::vector<std::optional<Eigen::Vector2d>> displacements(n);
  for (size_t i = 0; i < n; ++i) {
    const Keypoint& to = frame->features.keypoints[i];
    positions[i] = {to.raw_x, to.raw_y};
    if (flow.last_keypoints()[i] == kNotFollowed) continue;
    const Keypoint& from = last.features.keypoints[flow.last_keypoints()[i]];
    displacements[i] = positions[i] - Eigen::Vector2d(from.raw_x, from.raw_y);
  }
  const SelectiveResult result = SelectiveTracking(options_.selective, positions, displacements, boxes_);
  for (size_t i = 0; i < n; ++i) {
    const bool used =
        result.keypoints[i] == KeypointJudgement::kStatic || result.keypoints[i] == KeypointJudgement::kKept;
    frame->static_probability[i] = used ? 1 : 0;
  }
}

void DynamicFilter::FindMovers(const KeypointFlow& flow) {
  movers_.clear();
  boxes_before_.clear();
  expected_px_.clear();
  for (size_t k = 0; k < objects_.size(); ++k) {
    for (const Object& before : last_objects_) {
      if (before.box.track_id != objects_[k].box.track_id) continue;
      const Box &a = before.box.box, &b = boxes_[k];
      movers_.push_back({k, a, b, KeypointFlow::kReach * std::sqrt(b.Area()), {}});
      boxes_before_.push_back(a);
      expected_px_.emplace_back(b.CenterX() - a.CenterX(), b.CenterY() - a.CenterY());
    }
  }
  const std::span<const std::optional<BoxMotion>> motions =
      estimator_.Estimate(boxes_before_, expected_px_, flow.motions());
  size_t found = 0;
  for (size_t k = 0; k < movers_.size(); ++k) {
    if (!motions[k]) continue;
    movers_[found] = movers_[k];
    movers_[found++].motion = *motions[k];
  }
  movers_.resize(found);
}

// Whether the object as a whole moved. Where what is at rest shows no parallax, neither does an object that
// is far off or that drives ahead.
void DynamicFilter::WatchObject(const Mover& mover, const Rigid3& frame_from_last, double nearest_depth) {
  const Eigen::Vector2d raw(mover.from.CenterX(), mover.from.CenterY());
  const Eigen::Vector2d before_px = camera_.Undistort(raw);
  const Eigen::Vector3d far = frame_from_last.rotation * camera_.Unproject(before_px);
  const Eigen::Vector3d near = nearest_depth * far + frame_from_last.translation;
  if (far.z() <= 0 || near.z() <= 0) return;
  const Eigen::Vector2d far_px = camera_.Project(far), near_px = camera_.Project(near);
  const Eigen::Vector2d moved_px = before_px + mover.motion.shift_px;
  const double sigma_px = std::numbers::sqrt2;
  const bool moves = DistanceToSegment(moved_px, far_px, near_px) > kApart * sigma_px;
  if (!moves && (moved_px - far_px).norm() < kApart * sigma_px) return;
  double& odds = objects_[mover.object].motion_log_odds;
  odds = std::clamp(odds - EvidenceOfRest(!moves), -kMostObjectEvidence, kMostObjectEvidence);
}

void DynamicFilter::Watch(const KeypointFlow& flow, const Frame& last, double median_depth, Frame* frame) {
  if (options_.method != "weights" || !options_.motion || flow.motions().empty()) return;
  DS_TRACE("tracking/watch");
  FindMovers(flow);
  if (movers_.empty()) return;
  const Rigid3 frame_from_last = frame->cam_from_world * last.cam_from_world.Inverse();
  const double nearest_depth = kNearestDepthRatio * median_depth;
  for (const Mover& mover : movers_) WatchObject(mover, frame_from_last, nearest_depth);
  const Eigen::Matrix3d rotation = frame_from_last.Matrix();
  // At rest, it lies on the epipolar line between where infinity and the nearest depth go.
  const auto rest = [&](const Eigen::Vector2d& before_px) -> std::optional<RestPlace> {
    const Eigen::Vector3d far = rotation * camera_.Unproject(before_px);
    const Eigen::Vector3d near = nearest_depth * far + frame_from_last.translation;
    if (far.z() <= 0 || near.z() <= 0) return std::nullopt;
    return RestPlace{camera_.Project(far), camera_.Project(near)};
  };
  WatchKeypoints(rest, flow, last, frame);
  ShareInCells(frame->grid, flow.last_keypoints(), frame->motion_log_odds);
  if (options_.past_views) AskPastViews(flow, nearest_depth, frame);
  CombineAll(frame);
}

void DynamicFilter::AskPastViews(const KeypointFlow& flow, double nearest_depth, Frame* frame) {
  for (size_t k = 0, m = 0; k < objects_.size(); ++k) {
    if (m < movers_.size() && movers_[m].object == k) {
      objects_[k].shifts.Add(movers_[m++].motion.shift_px);
    } else {
      objects_[k].shifts.Clear();
    }
  }
  suspects_.clear();
  for (const Object& object : objects_)
    suspects_.push_back({object.box.box, object.margin_px, &object.shifts});
  ChooseWitnesses(*frame, by_boxes_.in_box, flow.last_keypoints(), &asked_);
  const std::span<const float> evidence = past_views_.Judge(*frame, asked_, suspects_, nearest_depth);
  for (size_t i = 0; i < evidence.size(); ++i) {
    AddEvidence(evidence[i], &frame->motion_log_odds[i]);
  }
  past_views_.Add(*frame);
}

void DynamicFilter::WatchBeforePose(const KeypointFlow& flow, const Frame& last, Frame* frame) {
  if (options_.method != "weights" || !options_.motion || flow.motions().empty()) return;
  DS_TRACE("tracking/watch");
  FindMovers(flow);
  if (movers_.empty()) return;
  std::vector<PointMotion> outside;
  for (const uint32_t i : flow.followed()) {
    const uint32_t from = flow.last_keypoints()[i];
    if (frame->static_probability[i] < kMinStaticProbability ||
        last.StaticProbability(from) < kMinStaticProbability) {
      continue;
    }
    const Keypoint &before = last.features.keypoints[from], &now = frame->features.keypoints[i];
    outside.push_back({{before.x, before.y}, {now.x, now.y}});
  }
  const std::optional<RestFlow> flow_at_rest = RestFlow::Fit(outside);
  if (!flow_at_rest.has_value()) return;
  const auto rest = [&](const Eigen::Vector2d& before_px) -> std::optional<RestPlace> {
    const Eigen::Vector2d px = flow_at_rest->Move(before_px);
    return RestPlace{px, px, flow_at_rest->Variance(before_px)};
  };
  WatchKeypoints(rest, flow, last, frame);
  CombineAll(frame);
}

template <class Rest>
void DynamicFilter::WatchKeypoints(const Rest& rest, const KeypointFlow& flow, const Frame& last,
                                   Frame* frame) const {
  const double mismatch = kMismatchShare / (std::numbers::pi * Square(flow.radius_px()));  // 1/px^2
  for (const uint32_t i : flow.followed()) {
    const Keypoint& now = frame->features.keypoints[i];
    const auto is_around = [&](const Mover& mover) {
      return mover.to.Contains(now.raw_x, now.raw_y, mover.ring_px);
    };
    if (std::none_of(movers_.begin(), movers_.end(), is_around)) continue;
    const Keypoint& before = last.features.keypoints[flow.last_keypoints()[i]];
    const Eigen::Vector2d px(now.x, now.y), before_px(before.x, before.y);
    const std::optional<RestPlace> place = rest(before_px);
    if (!place.has_value()) continue;
    // Noise of both ends.
    const double noise_px =
        std::numbers::sqrt2 * octave_scales_[static_cast<size_t>(std::max(now.octave, before.octave))];
    const double sigma_px = std::sqrt(Square(noise_px) + place->variance_px2);
    const double rest_error_px = DistanceToSegment(px, place->far_px, place->near_px);
    // Spread over the segment and the noise about it.
    const double length_px = (place->near_px - place->far_px).norm();
    const double area_px2 =
        2 * std::numbers::pi * sigma_px * (sigma_px + length_px / std::sqrt(2 * std::numbers::pi));
    const double rest_density = std::exp(-0.5 * Square(rest_error_px / sigma_px)) / area_px2 + mismatch;
    // It belongs to any of the objects about it, each as likely as the other: that it does not move as one
    // who walks tells little where another stands.
    double sum_density = 0;
    int objects = 0;
    for (const Mover& mover : movers_) {
      if (!is_around(mover)) continue;
      ++objects;
      const Eigen::Vector2d center(mover.from.CenterX(), mover.from.CenterY());
      const Eigen::Vector2d raw_before(before.raw_x, before.raw_y);
      const Eigen::Vector2d moved_px =
          before_px + mover.motion.shift_px + (mover.motion.scale - 1) * (raw_before - center);
      const double apart_px = DistanceToSegment(moved_px, place->far_px, place->near_px);
      if (apart_px < kApart * sigma_px) {
        // Who moves as what is at rest does gives no evidence: people stand still for a while.
        sum_density += rest_density;
        continue;
      }
      // Limbs swing to and fro beside the body.
      const double mover_sigma_px = std::max(sigma_px, kLimbs * apart_px);
      const double density = std::exp(-0.5 * Square((px - moved_px).norm() / mover_sigma_px)) /
                             (2 * std::numbers::pi * mover_sigma_px * mover_sigma_px);
      sum_density += density + mismatch;
    }
    const double evidence = std::log(rest_density * objects / sum_density);
    AddEvidence(std::clamp(evidence, -kMostEvidence, kMostEvidence), &frame->motion_log_odds[i]);
  }
}

}  // namespace dynamic_slam
