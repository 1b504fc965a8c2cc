#include <algorithm>
#include <cmath>

#include "dynamic_slam/sim/mesh_renderer.h"

// The part of MeshRenderer that says how much of an object is seen.

namespace dynamic_slam {

double MeshRenderer::VisibleShare(const std::vector<const MeshInstance*>& instances, int object,
                                  const RenderedView& view, const Rigid3& world_from_cam) const {
  // The silhouette on a coarse grid in the ideal image, which ends two images away.
  const Rigid3 cam_from_world = world_from_cam.Inverse();
  std::vector<Eigen::Vector2d> corners;  // three for each triangle
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  const Eigen::Vector2d size(camera_.width, camera_.height);
  for (const MeshInstance* instance : instances) {
    if (instance->object != object) continue;
    const Rigid3 cam_from_mesh = cam_from_world * instance->world_from_mesh;
    for (const Mesh::Corners& triangle : instance->mesh->triangles) {
      Eigen::Vector2d px[3];
      bool ahead = true;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d x =
            cam_from_mesh * instance->mesh->points[triangle.point[k]].cast<double>().eval();
        ahead = ahead && x.z() > kNearestDrawn;
        if (ahead) px[k] = camera_.Project(x).cwiseMax(-2 * size).cwiseMin(3 * size);
      }
      if (!ahead) continue;
      for (const Eigen::Vector2d& p : px) {
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
        corners.push_back(p);
      }
    }
  }
  if (corners.empty()) return 0;
  constexpr int kCells = 64;
  const double cell = std::max((high - low).maxCoeff() / kCells, 0.5);
  const int columns = static_cast<int>((high.x() - low.x()) / cell) + 1;
  const int rows = static_cast<int>((high.y() - low.y()) / cell) + 1;
  cv::Mat1b grid(rows, columns, uint8_t{0});
  for (size_t i = 0; i < corners.size(); i += 3) {
    const Eigen::Vector2d a = (corners[i] - low) / cell, b = (corners[i + 1] - low) / cell,
                          c = (corners[i + 2] - low) / cell;
    const auto edge = [](const Eigen::Vector2d& from, const Eigen::Vector2d& to, double x, double y) {
      return (to.x() - from.x()) * (y - from.y()) - (to.y() - from.y()) * (x - from.x());
    };
    const double sign = edge(a, b, c.x(), c.y()) >= 0 ? 1 : -1;
    const Eigen::Vector2d least = a.cwiseMin(b).cwiseMin(c), most = a.cwiseMax(b).cwiseMax(c);
    for (int y = static_cast<int>(least.y()); y <= std::min(static_cast<int>(most.y()), rows - 1); ++y) {
      for (int x = static_cast<int>(least.x()); x <= std::min(static_cast<int>(most.x()), columns - 1); ++x) {
        const double px = x + 0.5, py = y + 0.5;
        if (sign * edge(a, b, px, py) >= 0 && sign * edge(b, c, px, py) >= 0 &&
            sign * edge(c, a, px, py) >= 0) {
          grid(y, x) = 1;
        }
      }
    }
  }
  int whole = 0, shown = 0;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      if (grid(y, x) == 0) continue;
      ++whole;
      const Eigen::Vector2d ideal = low + Eigen::Vector2d(x + 0.5, y + 0.5) * cell;
      const Eigen::Vector3d ray = camera_.Unproject(ideal);
      if (ray.x() < low_x_ || ray.x() > high_x_ || ray.y() < low_y_ || ray.y() > high_y_) continue;
      const Eigen::Vector2d raw = camera_.Distort(ideal);
      const int column = static_cast<int>(std::lround(raw.x())), row = static_cast<int>(std::lround(raw.y()));
      if (column < 0 || row < 0 || column >= camera_.width || row >= camera_.height) continue;
      if (view.objects(row, column) == object) ++shown;
    }
  }
  return whole == 0 ? 1.0 : static_cast<double>(shown) / whole;
}

}  // namespace dynamic_slam
