#include "dynamic_slam/io/colmap_model.h"

#include <iterator>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

// From our pixels to COLMAP's.
constexpr double kPixelOffset = 0.5;

// CAMERA_ID MODEL WIDTH HEIGHT PARAMS, by COLMAP's camera models: the simplest that has all coefficients.
std::string CameraLine(const Camera& c) {
  std::string model = "PINHOLE", more;
  if (c.model == LensModel::kKannalaBrandt) {
    model = "OPENCV_FISHEYE";
    more = fmt::format(" {} {} {} {}", c.k1, c.k2, c.k3, c.k4);
  } else if (c.HasDistortion()) {
    model = c.k3 == 0 ? "OPENCV" : "FULL_OPENCV";
    more = fmt::format(" {} {} {} {}", c.k1, c.k2, c.p1, c.p2);
    if (c.k3 != 0) more += fmt::format(" {} 0 0 0", c.k3);
  }
  return fmt::format("1 {} {} {} {} {} {} {}{}\n", model, c.width, c.height, c.fx, c.fy, c.cx + kPixelOffset,
                     c.cy + kPixelOffset, more);
}

// Mean distance between where the landmark is seen and where it should be, ideal px.
double ReprojectionError(const Camera& camera, const Map& map, const Landmark& landmark) {
  double sum = 0;
  for (const Observation& observation : landmark.observations()) {
    const Keyframe& keyframe = map.keyframes().At(observation.keyframe);
    const Keypoint& keypoint = keyframe.keypoint(observation.keypoint);
    sum += (camera.Project(keyframe.cam_from_world() * landmark.position()) -
            Eigen::Vector2d(keypoint.x, keypoint.y))
               .norm();
  }
  return sum / static_cast<double>(landmark.observations().size());
}

}  // namespace

void WriteColmapModel(const std::filesystem::path& folder, const Camera& camera, const Map& map,
                      PartId part) {
  WriteFileAtomically(folder / "cameras.txt",
                      "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n" + CameraLine(camera));
  std::string images = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[] as (X Y POINT3D_ID)\n";
  map.keyframes().ForEach([&](const Keyframe& keyframe) {
    if (keyframe.part() != part) return;
    const Eigen::Quaterniond& q = keyframe.cam_from_world().rotation;
    const Eigen::Vector3d& t = keyframe.cam_from_world().translation;
    fmt::format_to(std::back_inserter(images), "{} {} {} {} {} {} {} {} 1 {:.6f}.png\n",
                   keyframe.id().value() + 1, q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z(),
                   keyframe.timestamp_s());
    const char* separator = "";
    for (uint32_t i = 0; i < keyframe.features().size(); ++i) {
      const Keypoint& keypoint = keyframe.keypoint(i);
      const LandmarkId landmark = keyframe.landmarks()[i];
      fmt::format_to(std::back_inserter(images), "{}{} {} {}", separator, keypoint.raw_x + kPixelOffset,
                     keypoint.raw_y + kPixelOffset,
                     landmark.IsValid() ? static_cast<int64_t>(landmark.value()) + 1 : -1);
      separator = " ";
    }
    images += '\n';
  });
  WriteFileAtomically(folder / "images.txt", images);
  std::string points = "# POINT3D_ID X Y Z R G B ERROR TRACK[] as (IMAGE_ID POINT2D_IDX)\n";
  map.landmarks().ForEach([&](const Landmark& landmark) {
    if (map.PartOf(landmark) != part) return;
    const Eigen::Vector3d& p = landmark.position();
    fmt::format_to(std::back_inserter(points), "{} {} {} {} 128 128 128 {}", landmark.id().value() + 1, p.x(),
                   p.y(), p.z(), ReprojectionError(camera, map, landmark));
    for (const Observation& observation : landmark.observations()) {
      fmt::format_to(std::back_inserter(points), " {} {}", observation.keyframe.value() + 1,
                     observation.keypoint);
    }
    points += '\n';
  });
  WriteFileAtomically(folder / "points3D.txt", points);
}

}  // namespace dynamic_slam
