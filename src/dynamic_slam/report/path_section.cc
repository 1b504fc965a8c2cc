#include "dynamic_slam/report/path_section.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/core.h>

#include "dynamic_slam/eval/trajectory_plot.h"
#include "dynamic_slam/report/report_page.h"

namespace dynamic_slam {
namespace {

constexpr size_t kMostPoses = 10000, kMostPoints = 3000;  // in the page, for its size
constexpr double kBesideRatio = 1.0;  // landmarks farther from the path than its extent are not shown

using Columns = std::array<nlohmann::ordered_json, 3>;

class Positions {
 public:
  explicit Positions(double extent)
      : digits_(std::clamp(4 - static_cast<int>(std::floor(std::log10(std::max(extent, 1e-6)))), 1, 6)) {
    columns_.fill(nlohmann::ordered_json::array());
  }

  void Add(const Eigen::Vector3d& position) {
    for (size_t axis = 0; axis < 3; ++axis) {
      columns_[axis].push_back(Rounded(position[static_cast<Eigen::Index>(axis)], digits_));
    }
  }

  nlohmann::ordered_json Json() const { return {columns_[0], columns_[1], columns_[2]}; }

 private:
  int digits_;
  Columns columns_;
};

size_t Stride(size_t count, size_t most) { return std::max<size_t>(1, (count + most - 1) / most); }

nlohmann::ordered_json TrackJson(const PathTrack& track, double start_s, double extent) {
  Positions positions(extent);
  nlohmann::ordered_json times = nlohmann::ordered_json::array(), errors = nlohmann::ordered_json::array();
  const size_t stride = Stride(track.path.size(), kMostPoses);
  auto error = track.errors.begin();
  for (size_t i = 0; i < track.path.size(); i += stride) {
    const StampedPose& pose = track.path[i];
    positions.Add(track.shown_from_world * pose.world_from_cam.translation);
    times.push_back(Rounded(pose.timestamp_s - start_s, 4));
    while (error != track.errors.end() && error->timestamp_s < pose.timestamp_s) ++error;
    const bool is_known = error != track.errors.end() && error->timestamp_s == pose.timestamp_s;
    errors.push_back(is_known ? Rounded(error->translation_m, 5) : nlohmann::ordered_json());
  }
  nlohmann::ordered_json json = {
      {"name", track.name}, {"colour", track.colour}, {"p", positions.Json()}, {"t", std::move(times)}};
  json["e"] = track.errors.empty() ? nlohmann::ordered_json() : std::move(errors);
  return json;
}

nlohmann::ordered_json TruthJson(const Trajectory& truth, double extent) {
  Positions positions(extent);
  const size_t stride = Stride(truth.size(), kMostPoses);
  for (size_t i = 0; i < truth.size(); i += stride) positions.Add(truth[i].world_from_cam.translation);
  return positions.Json();
}

struct Bounds {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e300), high = Eigen::Vector3d::Constant(-1e300);

  void Include(const Eigen::Vector3d& position) {
    low = low.cwiseMin(position);
    high = high.cwiseMax(position);
  }
  double Extent() const { return std::max(0.0, (high - low).maxCoeff()); }
  bool IsNear(const Eigen::Vector3d& position) const {
    const Eigen::Vector3d room = Eigen::Vector3d::Constant(kBesideRatio * Extent());
    return ((position - low + room).array() >= 0).all() && ((high + room - position).array() >= 0).all();
  }
};

nlohmann::ordered_json PointsJson(const PathPicture& picture, const Bounds& bounds) {
  Positions positions(bounds.Extent());
  const size_t stride = Stride(picture.points.size(), kMostPoints);
  for (size_t i = 0; i < picture.points.size(); i += stride) {
    const Eigen::Vector3d shown = picture.tracks.front().shown_from_world * picture.points[i].cast<double>();
    if (bounds.IsNear(shown)) positions.Add(shown);
  }
  return positions.Json();
}

// Axes to the right and upwards. y points down in the frames of cameras, in which the plane of motion is x-z.
nlohmann::ordered_json View(const std::string& title, int right, int up) {
  static constexpr std::array<const char*, 3> kNames = {"x", "y", "z"};
  const bool is_down = up == 1 && right != 0;
  return {{"title", title},
          {"x", right},
          {"y", up},
          {"sx", 1},
          {"sy", is_down ? -1 : 1},
          {"xName", kNames[static_cast<size_t>(right)]},
          {"yName", fmt::format("{}{}", is_down ? "−" : "", kNames[static_cast<size_t>(up)])}};
}

}  // namespace

nlohmann::ordered_json PathsSection(const PathPicture& picture) {
  Bounds bounds;
  std::vector<Eigen::Vector3d> all;
  const auto include = [&](const Trajectory& path, const Sim3& shown_from_world) {
    for (const StampedPose& pose : path) {
      all.push_back(shown_from_world * pose.world_from_cam.translation);
      bounds.Include(all.back());
    }
  };
  if (picture.truth.has_value()) include(*picture.truth, {});
  double most_error = 0;
  bool has_errors = false;
  for (const PathTrack& track : picture.tracks) {
    include(track.path, track.shown_from_world);
    for (const PoseError& error : track.errors) most_error = std::max(most_error, error.translation_m);
    has_errors |= !track.errors.empty();
  }
  nlohmann::ordered_json tracks = nlohmann::ordered_json::array();
  for (const PathTrack& track : picture.tracks) {
    tracks.push_back(TrackJson(track, picture.start_s, bounds.Extent()));
  }
  const std::array<int, 2> plane = LargestPlane(all);
  const int third = 3 - plane[0] - plane[1];
  nlohmann::ordered_json json = {{"type", "paths"}, {"title", picture.title}, {"note", picture.note}};
  json["unit"] = picture.truth.has_value() ? "m" : "units of the map";
  // The side is seen along the second axis of the plane, so that both views share the first.
  json["views"] = {View("From above", plane[0], plane[1]), View("From the side", plane[0], third)};
  if (plane == std::array<int, 2>{0, 2}) json["views"][1] = View("From the side", 2, 1);
  json["truth"] =
      picture.truth.has_value() ? TruthJson(*picture.truth, bounds.Extent()) : nlohmann::ordered_json();
  json["points"] = picture.points.empty() ? nlohmann::ordered_json() : PointsJson(picture, bounds);
  json["tracks"] = std::move(tracks);
  json["colour"] = nullptr;
  if (has_errors)
    json["colour"] = {{"title", "APE"}, {"unit", "m"}, {"min", 0}, {"max", Rounded(most_error, 6)}};
  return json;
}

}  // namespace dynamic_slam
