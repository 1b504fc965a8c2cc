#include "dynamic_slam/semantics/tracker_compensation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "dynamic_slam/geometry/chi2.h"
#include "dynamic_slam/semantics/assignment.h"

namespace dynamic_slam {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr double kOtherClassIou = 0.6;  // a detection of another class must overlap by this
constexpr double kBorder = 0.01;        // of the image's size: a box so near to the border is cut by it
// Of an unseen box in the image, else it is not shown. Half is what counts as visible; a little less, as how
// far a box reaches outside is a guess.
constexpr double kMinVisibleShare = 0.4;
constexpr double kHiddenShare = 0.5;   // of a box behind another one
constexpr double kCoveredShare = 0.3;  // of a box below another detection: what is seen of it may be a part
constexpr double kDoubtfulNoise = 4;   // times the noise of a box that may be a part
constexpr double kScoreLimit = 0.95;   // no single detection is surer than this
constexpr double kMaxStep_s = 1.0;
// Two objects are two when they were seen beside each other so often: the confirmation of tracks in Wojke et
// al., "Simple Online and Realtime Tracking with a Deep Association Metric", ICIP 2017.
constexpr int kConfirmations = 3;

double Logit(double probability) { return std::log(probability / (1 - probability)); }

// Adds to the value of a key.
template <class Value>
void AddTo(std::vector<std::pair<int, Value>>* values, int key, Value more) {
  const auto entry =
      std::find_if(values->begin(), values->end(), [key](const auto& v) { return v.first == key; });
  if (entry == values->end()) {
    values->emplace_back(key, more);
  } else {
    entry->second += more;
  }
}

// How the neighbourhood of a pixel moves when the camera turns.
struct Turn {
  Eigen::Vector2d shift_px;
  Eigen::Matrix2d jacobian;
};

// How the points outside the boxes move, px; nothing when there are too few.
std::optional<Eigen::Vector2d> BackgroundMotion(const std::vector<BoxTrack>& tracks,
                                                std::span<const PointMotion> motions) {
  constexpr size_t kMinPoints = 20;
  std::vector<Box> boxes;
  for (const BoxTrack& track : tracks) boxes.push_back(track.filter.box());
  std::vector<double> dx, dy;
  for (const PointMotion& motion : motions) {
    const bool is_on_object = std::any_of(boxes.begin(), boxes.end(), [&](const Box& box) {
      return box.Contains(motion.from_px.x(), motion.from_px.y());
    });
    if (is_on_object || !motion.to_px.allFinite()) continue;
    dx.push_back(motion.to_px.x() - motion.from_px.x());
    dy.push_back(motion.to_px.y() - motion.from_px.y());
  }
  if (dx.size() < kMinPoints) return std::nullopt;
  return Eigen::Vector2d(Median(&dx), Median(&dy));
}

// Nothing when the pixel turns out of view.
std::optional<Turn> RotateImage(const Camera& camera, const Eigen::Quaterniond& cam_from_last,
                                const Eigen::Vector2d& at_px) {
  // The lens model holds inside the image only: what is outside moves as its nearest pixel inside.
  const Eigen::Vector2d from = at_px.cwiseMax(0).cwiseMin(Eigen::Vector2d(camera.width, camera.height));
  Eigen::Matrix<double, 2, 3> moved;
  for (int i = 0; i < 3; ++i) {
    Eigen::Vector2d pixel = from;
    if (i > 0) pixel[i - 1] += 1;
    const Eigen::Vector3d ray = cam_from_last * camera.Unproject(camera.Undistort(pixel)).normalized();
    if (ray.z() < 0.1) return std::nullopt;
    moved.col(i) = camera.Distort(camera.Project(ray));
  }
  Turn motion{moved.col(0) - from, {}};
  motion.jacobian << moved.col(1) - moved.col(0), moved.col(2) - moved.col(0);
  if (!motion.shift_px.allFinite() || !motion.jacobian.allFinite()) return std::nullopt;
  return motion;
}

// Counts for each pair of objects the frames in which both are seen apart.
void NoteNeighbours(std::vector<BoxTrack>* tracks) {
  for (BoxTrack& track : *tracks) {
    for (const BoxTrack& other : *tracks) {
      if (other.id == track.id || !track.is_detected || !other.is_detected) continue;
      const double least_area = std::min(track.seen.box.Area(), other.seen.box.Area());
      if (IntersectionArea(track.seen.box, other.seen.box) > kCoveredShare * least_area) continue;
      AddTo(&track.frames_beside, other.id, 1);
    }
  }
}

// So that what a track remembers does not grow for ever.
void ForgetOldNeighbours(std::vector<BoxTrack>* tracks) {
  for (BoxTrack& track : *tracks) {
    std::erase_if(track.frames_beside, [&](const auto& beside) {
      return std::none_of(tracks->begin(), tracks->end(),
                          [&](const BoxTrack& other) { return other.id == beside.first; });
    });
  }
}

}  // namespace

int BoxTrack::ClassId() const {
  return std::max_element(class_votes.begin(), class_votes.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

int BoxTrack::FramesBeside(int other) const {
  const auto known = std::find_if(frames_beside.begin(), frames_beside.end(),
                                  [other](const auto& f) { return f.first == other; });
  return known == frames_beside.end() ? 0 : known->second;
}

TrackerCompensation::TrackerCompensation(const TrackerCompensationOptions& options, const Camera& camera)
    : options_(options), camera_(camera) {}

std::vector<Detection> TrackerCompensation::Usable(std::span<const Detection> detections) const {
  return UsableDetections(detections, camera_, options_.min_score, options_.max_boxes,
                          options_.max_duplicate_iou);
}

double TrackerCompensation::Evidence(double score) const {
  return std::max(0.0,
                  Logit(std::clamp(score, 1 - kScoreLimit, kScoreLimit)) - Logit(options_.neutral_score));
}

void TrackerCompensation::Advance(const CompensationInput& input, TrackerState* state) {
  Predict(input, state);
  if (input.detections) {
    for (const Detection& detection : Match(*input.detections, state)) Begin(detection, state);
  }
  if (std::erase_if(state->tracks, [&](const BoxTrack& track) { return IsOver(track); }) > 0) {
    ForgetOldNeighbours(&state->tracks);
  }
}

void TrackerCompensation::Predict(const CompensationInput& input, TrackerState* state) {
  double elapsed_s = input.timestamp_s - state->timestamp_s;
  if (!(elapsed_s > 0)) elapsed_s = 1 / (camera_.fps > 0 ? camera_.fps : 30);
  state->timestamp_s = input.timestamp_s;
  std::optional<Eigen::Vector2d> background_px;
  if (!input.cam_from_last) background_px = BackgroundMotion(state->tracks, input.motions);
  const double step_s = std::min(elapsed_s, kMaxStep_s);
  std::vector<Box> boxes;
  std::vector<Turn> turns;  // how the image moves there because the camera does
  std::vector<Eigen::Vector2d> expected_px;
  for (BoxTrack& track : state->tracks) {
    track.is_detected = false;
    track.unseen_s += elapsed_s;
    ++track.age_frames;
    ++track.missed_frames;
    const Box box = track.filter.box();
    Turn camera{background_px.value_or(Eigen::Vector2d::Zero()), Eigen::Matrix2d::Identity()};
    if (input.cam_from_last) {
      const std::optional<Turn> turn =
          RotateImage(camera_, *input.cam_from_last, {box.CenterX(), box.CenterY()});
      if (turn) {
        camera = *turn;
      } else {
        track.unseen_s = kNever;
      }
    }
    boxes.push_back(box);
    turns.push_back(camera);
    expected_px.push_back(camera.shift_px + step_s * track.filter.velocity_px_s());
  }
  const std::span<const std::optional<BoxMotion>> seen =
      estimator_.Estimate(boxes, expected_px, input.motions);
  for (size_t t = 0; t < boxes.size(); ++t) {
    BoxFilter& filter = state->tracks[t].filter;
    if (seen[t]) {
      filter.Follow(options_.filter, step_s, seen[t]->shift_px, seen[t]->scale, turns[t].shift_px);
    } else {
      filter.Predict(options_.filter, step_s);
      filter.Move(turns[t].shift_px, turns[t].jacobian);
    }
  }
}

double TrackerCompensation::Cost(const BoxTrack& track, const Detection& detection, bool same_class) const {
  if ((track.ClassId() == detection.class_id) != same_class) return kNever;
  const Box predicted = track.filter.box();
  const double iou = IoU(ClipToImage(predicted, camera_), detection.box);
  if (!same_class) return iou >= kOtherClassIou ? 1 - iou : kNever;
  // Distance decides between boxes that the prediction does not reach.
  const double distance =
      track.filter.SquaredDistance(options_.filter, Completed(detection.box, predicted)) / kChi2FourDof;
  if (iou < options_.min_iou && distance > 1) return kNever;
  return 1 - iou + 0.1 * std::min(distance, 1.0);
}

std::vector<Detection> TrackerCompensation::Match(const std::vector<Detection>& detections,
                                                  TrackerState* state) const {
  std::vector<BoxTrack>& tracks = state->tracks;
  std::vector<bool> is_used(detections.size(), false);
  // One round: the tracks still unseen against the unused detections.
  const auto assign = [&](bool same_class) {
    std::vector<size_t> rows, columns;
    for (size_t t = 0; t < tracks.size(); ++t) {
      if (!tracks[t].is_detected) rows.push_back(t);
    }
    for (size_t d = 0; d < detections.size(); ++d) {
      if (!is_used[d]) columns.push_back(d);
    }
    Eigen::MatrixXd costs(rows.size(), columns.size());
    for (size_t r = 0; r < rows.size(); ++r) {
      for (size_t c = 0; c < columns.size(); ++c) {
        costs(r, c) = Cost(tracks[rows[r]], detections[columns[c]], same_class);
      }
    }
    const std::vector<int> column_of = CheapestPairs(costs);
    for (size_t r = 0; r < rows.size(); ++r) {
      if (column_of[r] < 0) continue;
      const size_t d = columns[column_of[r]];
      is_used[d] = true;
      See(detections[d], detections, &tracks[rows[r]]);
    }
  };
  assign(true);
  assign(false);

  NoteNeighbours(&tracks);
  for (BoxTrack& track : tracks) {
    if (track.is_detected) continue;
    // What stands behind something else cannot be seen, which says little against it.
    track.evidence -= IsHidden(track, tracks) ? options_.hidden_evidence : options_.miss_evidence;
  }
  std::vector<Detection> left;
  for (size_t d = 0; d < detections.size(); ++d) {
    if (!is_used[d]) left.push_back(detections[d]);
  }
  return left;
}

void TrackerCompensation::See(const Detection& detection, const std::vector<Detection>& all,
                              BoxTrack* track) const {
  const Box predicted = track->filter.box();
  const bool is_covered = std::any_of(all.begin(), all.end(), [&](const Detection& other) {
    return &other != &detection && IntersectionArea(predicted, other.box) > kCoveredShare * predicted.Area();
  });
  track->filter.Update(options_.filter, Completed(detection.box, predicted), is_covered ? kDoubtfulNoise : 1);
  AddTo(&track->class_votes, detection.class_id, detection.score);
  track->evidence = std::min(track->evidence + Evidence(detection.score), options_.max_evidence);
  track->seen = detection;
  track->is_detected = true;
  track->unseen_s = 0;
  track->missed_frames = 0;
}

void TrackerCompensation::Begin(const Detection& detection, TrackerState* state) {
  if (state->tracks.size() >= static_cast<size_t>(options_.max_boxes)) return;
  BoxTrack track(NextTrackId(), BoxFilter(options_.filter, detection.box));
  track.class_votes.emplace_back(detection.class_id, detection.score);
  track.evidence = std::min(Evidence(detection.score), options_.max_evidence);
  track.seen = detection;
  track.is_detected = true;
  track.age_frames = 1;
  state->tracks.push_back(std::move(track));
}

bool TrackerCompensation::IsOver(const BoxTrack& track) const {
  return !track.is_detected && (track.evidence <= 0 || track.unseen_s > options_.max_unseen_s);
}

Box TrackerCompensation::Completed(const Box& detected, const Box& predicted) const {
  double left = detected.x, right = detected.x + detected.width;
  double top = detected.y, bottom = detected.y + detected.height;
  // At most as much again outside as there is inside.
  const double border_x = kBorder * camera_.width, border_y = kBorder * camera_.height;
  if (left < border_x) left = std::clamp(predicted.x, left - detected.width, left);
  if (top < border_y) top = std::clamp(predicted.y, top - detected.height, top);
  if (right > camera_.width - border_x) {
    right = std::clamp(predicted.x + predicted.width, right, right + detected.width);
  }
  if (bottom > camera_.height - border_y) {
    bottom = std::clamp(predicted.y + predicted.height, bottom, bottom + detected.height);
  }
  return {left, top, right - left, bottom - top};
}

bool TrackerCompensation::IsHidden(const BoxTrack& track, const std::vector<BoxTrack>& tracks) const {
  const Box box = ClipToImage(track.filter.box(), camera_);
  return std::any_of(tracks.begin(), tracks.end(), [&](const BoxTrack& other) {
    return other.is_detected && IntersectionArea(box, other.seen.box) > kHiddenShare * box.Area() &&
           track.FramesBeside(other.id) >= kConfirmations;
  });
}

std::vector<CompensatedBox> TrackerCompensation::BoxesOf(const TrackerState& state) const {
  std::vector<CompensatedBox> boxes;
  for (const BoxTrack& track : state.tracks) {
    const Box whole = track.filter.box();
    // What the detector sees is where it sees it: no box is made worse than it was.
    const Box box = track.is_detected ? track.seen.box : ClipToImage(whole, camera_);
    if (!track.is_detected && box.Area() < kMinVisibleShare * whole.Area()) continue;
    boxes.push_back({box, track.ClassId(), 1 / (1 + std::exp(-track.evidence)), track.id, track.is_detected,
                     track.age_frames, track.missed_frames});
  }
  return boxes;
}

}  // namespace dynamic_slam
