#include "dynamic_slam/geometry/path_roughness.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "dynamic_slam/base/percentile.h"
#include "dynamic_slam/geometry/path_leaps.h"
#include "dynamic_slam/geometry/umeyama.h"

namespace dynamic_slam {
namespace {

// Of which each lays the nearer half better on each other (Rousseeuw and Van Driessen 1999, C-steps).
constexpr int kAlignments = 20;

struct CommonPath {
  std::vector<double> stamps_s;
  std::vector<Eigen::Vector3d> a, b;  // centres
};

CommonPath PosesOfBoth(const Trajectory& a, const Trajectory& b) {
  CommonPath common;
  auto other = b.begin();
  for (const StampedPose& pose : a) {
    while (other != b.end() && other->timestamp_s < pose.timestamp_s) ++other;
    if (other == b.end() || other->timestamp_s != pose.timestamp_s) continue;
    common.stamps_s.push_back(pose.timestamp_s);
    common.a.push_back(pose.world_from_cam.translation);
    common.b.push_back(other->world_from_cam.translation);
  }
  return common;
}

// Moves b to where half of it lies as well on a as it can. Returns how far each is from the other then;
// nothing when that is not determined.
std::vector<double> LayOnEachOther(CommonPath* path) {
  std::vector<double> distances;
  double most = 0;
  for (int i = 0; i < kAlignments; ++i) {
    std::vector<Eigen::Vector3d> near_a, near_b;
    for (size_t k = 0; k < path->a.size(); ++k) {
      if (!distances.empty() && distances[k] > most) continue;
      near_a.push_back(path->a[k]);
      near_b.push_back(path->b[k]);
    }
    const std::optional<Sim3> a_from_b = AlignUmeyama(near_b, near_a, true);
    if (!a_from_b.has_value()) return {};
    distances.resize(path->a.size());
    for (size_t k = 0; k < path->a.size(); ++k) {
      path->b[k] = *a_from_b * path->b[k];
      distances[k] = (path->b[k] - path->a[k]).norm();
    }
    std::vector<double> sorted = distances;
    most = Percentile(0.5, &sorted);
  }
  return distances;
}

// By more than the rounding of the alignment.
bool Differ(const CommonPath& path, const std::vector<double>& differences) {
  double extent = 0;
  for (const Eigen::Vector3d& centre : path.a) extent = std::max(extent, (centre - path.a.front()).norm());
  return *std::max_element(differences.begin(), differences.end()) > 1e-9 * extent;
}

}  // namespace

std::pair<double, double> RoughnessWhereTheyDiffer(const Trajectory& a, const Trajectory& b) {
  CommonPath path = PosesOfBoth(a, b);
  const std::vector<double> differences = LayOnEachOther(&path);
  if (differences.empty() || !Differ(path, differences)) return {};
  const double longest_s = kNextFrame * MedianInterval_s(a);
  double weights = 0, rough_a = 0, rough_b = 0;
  for (size_t i = 1; i + 1 < path.a.size(); ++i) {
    const double before_s = path.stamps_s[i] - path.stamps_s[i - 1];
    const double after_s = path.stamps_s[i + 1] - path.stamps_s[i];
    if (std::max(before_s, after_s) > longest_s) continue;
    const auto departure = [&](const std::vector<Eigen::Vector3d>& at) {
      return (at[i + 1] - at[i] - (at[i] - at[i - 1]) * (after_s / before_s)).norm();
    };
    weights += differences[i];
    rough_a += differences[i] * departure(path.a);
    rough_b += differences[i] * departure(path.b);
  }
  if (!(weights > 0)) return {};
  return {rough_a / weights, rough_b / weights};
}

}  // namespace dynamic_slam
