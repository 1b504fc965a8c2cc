#include "dynamic_slam/map_view.h"

#include <algorithm>

#include <fmt/format.h>

#include "dynamic_slam/api/map_contents.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/colmap_model.h"
#include "dynamic_slam/io/point_cloud_file.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/map/map_file.h"

namespace dynamic_slam {

MapView ContentsOf(const Camera& camera, const Map& map) {
  MapView view{camera, {}};
  for (const PartId id : map.Parts()) {
    MapView::Part part{id.value(), {}, {}};
    map.keyframes().ForEach([&](const Keyframe& keyframe) {
      if (keyframe.part() != id) return;
      part.keyframes.push_back({keyframe.timestamp_s(), keyframe.cam_from_world().Inverse()});
    });
    map.landmarks().ForEach([&](const Landmark& landmark) {
      if (map.PartOf(landmark) != id) return;
      part.landmarks.push_back({landmark.id().value(), landmark.position(),
                                static_cast<int>(landmark.observations().size()), landmark.static_log_odds});
    });
    std::stable_sort(
        part.keyframes.begin(), part.keyframes.end(),
        [](const StampedPose& a, const StampedPose& b) { return a.timestamp_s < b.timestamp_s; });
    view.parts.push_back(std::move(part));
  }
  std::stable_sort(view.parts.begin(), view.parts.end(), [](const MapView::Part& a, const MapView::Part& b) {
    return a.keyframes.size() > b.keyframes.size();
  });
  return view;
}

MapView ReadMap(const std::filesystem::path& file) {
  const SavedMap saved = ReadMapFile(file);
  return ContentsOf(saved.camera, saved.map);
}

MapView::Part ExportMap(const std::filesystem::path& file, const std::filesystem::path& folder, int number) {
  const SavedMap saved = ReadMapFile(file);
  MapView view = ContentsOf(saved.camera, saved.map);
  if (number < 1 || static_cast<size_t>(number) > view.parts.size()) {
    throw InputError(file.string(), fmt::format("has {} parts, and no part {}", view.parts.size(), number),
                     "See `dynamic_slam map info`.");
  }
  MapView::Part& part = view.parts[static_cast<size_t>(number - 1)];
  std::vector<Eigen::Vector3f> points;
  for (const MapView::Landmark& landmark : part.landmarks) points.push_back(landmark.position.cast<float>());
  WritePly(folder / "map.ply", points);
  WriteTumTrajectory(folder / "keyframes.txt", part.keyframes);
  WriteColmapModel(folder / "colmap", saved.camera, saved.map, PartId(part.id));
  return std::move(part);
}

}  // namespace dynamic_slam
