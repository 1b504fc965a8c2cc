#include "dynamic_slam/viewer/map_picture.h"

#include <algorithm>

namespace dynamic_slam {
namespace {

// Of the covisibility graph: enough to show its shape, too few to hide the map behind.
constexpr size_t kNeighbours = 4;
constexpr int kMinShared = 30;

// Calls changed(value) for what is new or different in `to`, gone(id) for what only `from` has; both are
// sorted by id.
template <class T, class Changed, class Gone>
void Compare(const std::vector<T>& from, const std::vector<T>& to, Changed&& changed, Gone&& gone) {
  auto old = from.begin();
  for (const T& value : to) {
    for (; old != from.end() && old->id < value.id; ++old) gone(old->id);
    const bool is_known = old != from.end() && old->id == value.id;
    if (!is_known || !(*old == value)) changed(value);
    if (is_known) ++old;
  }
  for (; old != from.end(); ++old) gone(old->id);
}

std::array<float, 3> AsFloats(const Eigen::Vector3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

}  // namespace

std::array<float, 7> WorldFromCam(const Rigid3& cam_from_world) {
  const Rigid3 world_from_cam = cam_from_world.Inverse();
  const Eigen::Vector3f t = world_from_cam.translation.cast<float>();
  const Eigen::Vector4f q = world_from_cam.rotation.coeffs().cast<float>();
  return {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()};
}

MapPicture PictureOf(const Map& map, std::span<const PathFrame> path) {
  MapPicture picture;
  picture.points.reserve(map.landmarks().size());
  map.landmarks().ForEach([&](const Landmark& landmark) {
    picture.points.push_back(
        {landmark.id().value(), map.PartOf(landmark).value(), AsFloats(landmark.position())});
  });
  picture.cameras.reserve(map.keyframes().size());
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    MapPicture::Camera camera{
        keyframe.id().value(), keyframe.part().value(), WorldFromCam(keyframe.cam_from_world()), {}};
    for (const CovisibleKeyframe& other : keyframe.BestCovisible(kNeighbours, kMinShared)) {
      if (other.id < keyframe.id()) camera.neighbours.push_back(other.id.value());
    }
    picture.cameras.push_back(std::move(camera));
  });
  picture.path.reserve(path.size());
  for (const PathFrame& frame : path) {
    const PartId part = map.PartOf(frame.pose.reference);
    if (!part.IsValid()) continue;
    const Rigid3 cam_from_world = map.PoseFromReference(frame.pose.reference, frame.pose.cam_from_reference);
    picture.path.push_back({AsFloats(cam_from_world.TargetOriginInSource()), frame.stretch, part.value()});
    picture.part = part.value();
  }
  return picture;
}

Message MapMessage(const MapPicture& from, const MapPicture& to, uint32_t frame, bool is_whole) {
  std::vector<const MapPicture::Point*> points;
  std::vector<const MapPicture::Camera*> cameras;
  std::vector<uint32_t> gone_points, gone_cameras;
  Compare(
      from.points, to.points, [&](const MapPicture::Point& p) { points.push_back(&p); },
      [&](uint32_t id) { gone_points.push_back(id); });
  Compare(
      from.cameras, to.cameras, [&](const MapPicture::Camera& c) { cameras.push_back(&c); },
      [&](uint32_t id) { gone_cameras.push_back(id); });
  const size_t common = std::min(from.path.size(), to.path.size());
  const size_t same = static_cast<size_t>(
      std::mismatch(from.path.begin(), from.path.begin() + static_cast<ptrdiff_t>(common), to.path.begin())
          .first -
      from.path.begin());

  MessageWriter writer({MessageType::kMap, frame, is_whole});
  const auto add_count = [&writer](size_t count) { writer.Add(static_cast<uint32_t>(count)); };
  add_count(points.size());
  for (const MapPicture::Point* point : points) writer.Add(point->id);
  for (const MapPicture::Point* point : points) writer.Add(point->position);
  for (const MapPicture::Point* point : points) writer.Add(point->part);
  add_count(gone_points.size());
  for (const uint32_t id : gone_points) writer.Add(id);
  add_count(cameras.size());
  for (const MapPicture::Camera* camera : cameras) {
    writer.Add(camera->id);
    writer.Add(camera->part);
    writer.Add(camera->world_from_cam);
    add_count(camera->neighbours.size());
    for (const uint32_t neighbour : camera->neighbours) writer.Add(neighbour);
  }
  add_count(gone_cameras.size());
  for (const uint32_t id : gone_cameras) writer.Add(id);
  add_count(same);
  add_count(to.path.size() - same);
  for (size_t i = same; i < to.path.size(); ++i) {
    writer.Add(to.path[i].position);
    writer.Add(to.path[i].stretch);
    writer.Add(to.path[i].part);
  }
  writer.Add(to.part);
  return writer.Finish();
}

}  // namespace dynamic_slam
