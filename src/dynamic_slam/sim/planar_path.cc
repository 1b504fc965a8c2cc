#include "dynamic_slam/sim/planar_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

PlanarPath::Place Advance(const PlanarPath::Place& start, double distance_m, double curvature) {
  const double heading = start.heading_rad, turn = curvature * distance_m;
  // The chord: its length over the arc's is sin(x) / x, its direction the mean heading.
  const double half = 0.5 * turn, chord = std::abs(half) < 1e-9 ? 1.0 : std::sin(half) / half;
  const Eigen::Vector2d direction(std::cos(heading + half), std::sin(heading + half));
  return {start.position + distance_m * chord * direction, heading + turn};
}

}  // namespace

PlanarPath::PlanarPath(const std::vector<Eigen::Vector2d>& corners, double radius_m, bool closed)
    : closed_(closed) {
  const int count = static_cast<int>(corners.size());
  DS_CHECK(count >= 2);
  const auto corner = [&](int i) { return corners[(i + count) % count]; };
  // How much of the lines an arc takes away, on both sides of the corner.
  const auto turn_at = [&](int i) {
    const Eigen::Vector2d in = corner(i) - corner(i - 1), out = corner(i + 1) - corner(i);
    return std::remainder(std::atan2(out.y(), out.x()) - std::atan2(in.y(), in.x()), 2 * std::numbers::pi);
  };
  const auto cut_at = [&](int i) {
    if (!closed && (i == 0 || i == count - 1)) return 0.0;
    const double room =
        0.5 * std::min((corner(i) - corner(i - 1)).norm(), (corner(i + 1) - corner(i)).norm());
    return std::min(std::tan(0.5 * std::abs(turn_at(i))) * radius_m, room);
  };
  const Eigen::Vector2d first = (corner(1) - corner(0)).normalized();
  end_ = {corner(0) + cut_at(0) * first, std::atan2(first.y(), first.x())};
  const int lines = closed ? count : count - 1;
  for (int i = 0; i < lines; ++i) {
    const int next = (i + 1) % count;
    Append((corner(i + 1) - corner(i)).norm() - cut_at(i) - cut_at(next), 0);
    if (!closed && next == count - 1) break;
    const double turn = turn_at(next), cut = cut_at(next);
    if (std::abs(turn) < 1e-9 || cut < 1e-9) {
      end_.heading_rad += turn;
      continue;
    }
    const double radius = cut / std::tan(0.5 * std::abs(turn));
    Append(radius * std::abs(turn), (turn > 0 ? 1 : -1) / radius);
  }
}

PlanarPath PlanarPath::ToAndFro(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double width_m) {
  const Eigen::Vector2d along = (to - from).normalized(),
                        side = 0.5 * width_m * Eigen::Vector2d(-along.y(), along.x());
  return PlanarPath({from - side, to - side, to + side, from + side}, 0.5 * width_m, true);
}

void PlanarPath::Append(double length_m, double curvature) {
  if (length_m <= 0) return;
  pieces_.push_back({length_m_, length_m, end_, curvature});
  end_ = Advance(end_, length_m, curvature);
  length_m_ += length_m;
}

PlanarPath::Place PlanarPath::At(double distance_m) const {
  double turns = 0;
  if (closed_) {
    turns = std::floor(distance_m / length_m_);
    distance_m -= turns * length_m_;
  }
  distance_m = std::clamp(distance_m, 0.0, length_m_);
  const auto after = std::upper_bound(pieces_.begin(), pieces_.end(), distance_m,
                                      [](double d, const Piece& piece) { return d < piece.begin_m; });
  const Piece& piece = *std::prev(after);
  Place place = Advance(piece.start, distance_m - piece.begin_m, piece.curvature);
  place.heading_rad += turns * (end_.heading_rad - pieces_.front().start.heading_rad);
  return place;
}

}  // namespace dynamic_slam
