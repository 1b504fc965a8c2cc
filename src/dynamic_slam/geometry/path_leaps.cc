#include "dynamic_slam/geometry/path_leaps.h"

#include <algorithm>

#include "dynamic_slam/base/percentile.h"

namespace dynamic_slam {
namespace {

// A camera that is so many times as fast as it nearly always was between two frames is a wrong pose. With
// fewer steps known nobody can tell.
constexpr double kMaxSpeedRatio = 2, kNearlyAlways = 0.95;
constexpr size_t kMinSteps = 20;

// Steps that are too fast belong to one leap when so few or fewer are between them.
constexpr size_t kStepsBetween = 2;

// A smooth path is over a leap by then. What is fast for longer is a camera that went off at last.
constexpr size_t kMostSteps = 10;

double Speed(const StampedPose& a, const StampedPose& b) {
  return (b.world_from_cam.translation - a.world_from_cam.translation).norm() /
         (b.timestamp_s - a.timestamp_s);
}

// By the path itself.
std::optional<double> MostSpeedOf(const Trajectory& path) {
  if (path.size() < 2) return std::nullopt;
  const double max_gap_s = kMaxGapFrames * MedianInterval_s(path);
  std::vector<double> speeds;
  for (size_t i = 1; i < path.size(); ++i) {
    if (path[i].timestamp_s - path[i - 1].timestamp_s <= max_gap_s)
      speeds.push_back(Speed(path[i - 1], path[i]));
  }
  return MostSpeed(&speeds);
}

}  // namespace

double MedianInterval_s(const Trajectory& path) {
  std::vector<double> intervals_s;
  for (size_t i = 1; i < path.size(); ++i)
    intervals_s.push_back(path[i].timestamp_s - path[i - 1].timestamp_s);
  return Percentile(0.5, &intervals_s);
}

std::optional<double> MostSpeed(std::vector<double>* speeds) {
  if (speeds->size() < kMinSteps) return std::nullopt;
  return kMaxSpeedRatio * Percentile(kNearlyAlways, speeds);
}

std::optional<double> LongestStep(const Trajectory& path) {
  const std::optional<double> most = MostSpeedOf(path);
  return most.has_value() ? std::optional(*most * MedianInterval_s(path)) : std::nullopt;
}

std::vector<PathLeap> FindLeaps(const Trajectory& path) {
  std::vector<PathLeap> leaps;
  const std::optional<double> most = MostSpeedOf(path);
  if (!most.has_value() || !(*most > 0)) return leaps;
  for (size_t i = 0; i + 1 < path.size(); ++i) {
    const double speed = Speed(path[i], path[i + 1]);
    if (!(speed > *most)) continue;
    if (leaps.empty() || i > leaps.back().last + kStepsBetween)
      leaps.push_back({i, i, path[i].timestamp_s, 0, 0});
    leaps.back().last = i + 1;
    leaps.back().to_s = path[i + 1].timestamp_s;
    leaps.back().times_too_fast = std::max(leaps.back().times_too_fast, speed / *most);
  }
  std::erase_if(leaps, [](const PathLeap& leap) { return leap.last - leap.first > kMostSteps; });
  return leaps;
}

std::vector<size_t> CutAt(const std::vector<PathLeap>& leaps, const Trajectory& path) {
  if (path.empty()) return {};
  std::vector<size_t> begins{0};
  for (const PathLeap& leap : leaps) {
    size_t fastest = leap.first;
    for (size_t i = leap.first; i < leap.last; ++i) {
      if (Speed(path[i], path[i + 1]) > Speed(path[fastest], path[fastest + 1])) fastest = i;
    }
    begins.push_back(fastest + 1);
  }
  begins.push_back(path.size());

  const std::optional<double> most = MostSpeedOf(path);
  struct Piece {
    size_t last, size;
  };
  std::vector<Piece> pieces;
  std::vector<size_t> piece_of;
  for (size_t k = 0; k + 1 < begins.size(); ++k) {
    const size_t begin = begins[k], end = begins[k + 1];
    size_t piece = 0;
    // Not that before the leap, but one before that.
    const auto can_go_on = [&](size_t i) {
      return piece_of[begin - 1] != i && most.has_value() &&
             Speed(path[pieces[i].last], path[begin]) <= *most;
    };
    while (piece < pieces.size() && !can_go_on(piece)) ++piece;
    if (piece == pieces.size()) pieces.push_back({end - 1, 0});
    pieces[piece] = {end - 1, pieces[piece].size + end - begin};
    piece_of.insert(piece_of.end(), end - begin, piece);
  }
  const auto main =
      static_cast<size_t>(std::max_element(pieces.begin(), pieces.end(),
                                           [](const Piece& a, const Piece& b) { return a.size < b.size; }) -
                          pieces.begin());
  // Each of the others stands for itself: what lies before the main one says nothing of what lies after it.
  size_t count = 0;
  for (size_t k = 0; k + 1 < begins.size(); ++k) {
    const size_t number = piece_of[begins[k]] == main ? 0 : ++count;
    std::fill(piece_of.begin() + static_cast<std::ptrdiff_t>(begins[k]),
              piece_of.begin() + static_cast<std::ptrdiff_t>(begins[k + 1]), number);
  }
  return piece_of;
}

}  // namespace dynamic_slam
