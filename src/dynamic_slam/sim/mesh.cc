#include "dynamic_slam/sim/mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace dynamic_slam {

int Mesh::AddSurface(const Surface& surface) {
  surfaces.push_back(surface);
  return static_cast<int>(surfaces.size()) - 1;
}

int Mesh::AddPoint(const Eigen::Vector3d& x, const Eigen::Vector3d& normal, const Eigen::Vector2d& uv) {
  points.push_back(x.cast<float>());
  normals.push_back(normal.normalized().cast<float>());
  uvs.push_back(uv.cast<float>());
  return static_cast<int>(points.size()) - 1;
}

void Mesh::AddQuad(int surface, const Eigen::Vector3d& corner, const Eigen::Vector3d& edge_x,
                   const Eigen::Vector3d& edge_y, const Eigen::Vector2d& uv, const Eigen::Vector2d& uv0) {
  const Eigen::Vector3d normal = edge_y.cross(edge_x);
  const int a = AddPoint(corner, normal, uv0);
  const int b = AddPoint(corner + edge_y, normal, {uv0.x(), uv.y()});
  const int c = AddPoint(corner + edge_x + edge_y, normal, uv);
  const int d = AddPoint(corner + edge_x, normal, {uv.x(), uv0.y()});
  triangles.push_back({{a, b, c}, surface});
  triangles.push_back({{a, c, d}, surface});
}

void Mesh::AddBox(int surface, const Eigen::Vector3d& centre, const Eigen::Vector3d& size, double yaw_rad,
                  double texture_m) {
  const Eigen::AngleAxisd turn(yaw_rad, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d downs[] = {{0, 0, -1}, {0, 0, -1}, {0, 0, -1}, {0, 0, -1}, {0, -1, 0}, {0, 1, 0}};
  const Eigen::Vector3d normals_out[] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  for (int i = 0; i < 6; ++i) {
    const Eigen::Vector3d right = normals_out[i].cross(downs[i]);
    const Eigen::Vector3d edge_x = right.cwiseProduct(size), edge_y = downs[i].cwiseProduct(size);
    const Eigen::Vector3d corner = 0.5 * (normals_out[i].cwiseProduct(size) - edge_x - edge_y);
    const Eigen::Vector2d uv = texture_m > 0
                                   ? Eigen::Vector2d(edge_x.norm() / texture_m, edge_y.norm() / texture_m)
                                   : Eigen::Vector2d(1, 1);
    AddQuad(surface, centre + turn * corner, turn * edge_x, turn * edge_y, uv);
  }
}

void Mesh::AddLoft(int surface, std::span<const Ring> rings, const Eigen::Vector3d& across_x,
                   const Eigen::Vector3d& across_y, int sides) {
  const int first = static_cast<int>(points.size());
  const int count = static_cast<int>(rings.size());
  double length = 0;
  for (int i = 1; i < count; ++i) length += (rings[i].centre - rings[i - 1].centre).norm();
  double along = 0;
  const Eigen::Vector3d axis = (rings[count - 1].centre - rings[0].centre).normalized();
  for (int i = 0; i < count; ++i) {
    const Ring& ring = rings[i];
    if (i > 0) along += (ring.centre - rings[i - 1].centre).norm();
    const Ring &before = rings[std::max(i - 1, 0)], &after = rings[std::min(i + 1, count - 1)];
    const double step = std::max((after.centre - before.centre).norm(), 1e-6);
    const double slope = (after.radius_x + after.radius_y - before.radius_x - before.radius_y) / (2 * step);
    for (int k = 0; k <= sides; ++k) {
      const double angle = 2 * std::numbers::pi * k / sides;
      const double c = std::cos(angle), s = std::sin(angle);
      const Eigen::Vector3d out =
          c * across_x / std::max(ring.radius_x, 1e-3) + s * across_y / std::max(ring.radius_y, 1e-3);
      AddPoint(ring.centre + ring.radius_x * c * across_x + ring.radius_y * s * across_y,
               out.normalized() - slope * axis, {static_cast<double>(k) / sides, along / length});
    }
  }
  // Counter-clockwise from outside, whichever way the axis runs.
  const bool forward = across_x.cross(across_y).dot(axis) > 0;
  const auto add = [&](int a, int b, int c) {
    if (forward) {
      triangles.push_back({{a, b, c}, surface});
    } else {
      triangles.push_back({{a, c, b}, surface});
    }
  };
  for (int i = 0; i + 1 < count; ++i) {
    for (int k = 0; k < sides; ++k) {
      const int a = first + i * (sides + 1) + k, b = a + sides + 1;
      add(a, a + 1, b + 1);
      add(a, b + 1, b);
    }
  }
  const auto close = [&](int ring, bool end) {
    const int centre = AddPoint(rings[ring].centre, end ? axis : -axis, {0.5, end ? 1.0 : 0.0});
    for (int k = 0; k < sides; ++k) {
      const int a = first + ring * (sides + 1) + k;
      if (end) {
        add(a, a + 1, centre);
      } else {
        add(a + 1, a, centre);
      }
    }
  };
  close(0, false);
  close(count - 1, true);
}

void Mesh::AddEllipsoid(int surface, const Eigen::Vector3d& centre, const Eigen::Vector3d& radii, int sides,
                        int rings) {
  std::vector<Ring> all;
  for (int i = 0; i < rings; ++i) {
    const double polar = std::numbers::pi * (i + 0.25) / (rings - 0.5);
    all.push_back({centre + Eigen::Vector3d(0, 0, radii.z() * std::cos(polar)), radii.x() * std::sin(polar),
                   radii.y() * std::sin(polar)});
  }
  AddLoft(surface, all, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), sides);
}

void Mesh::Add(const Mesh& other, const Rigid3& this_from_other) {
  const int point_offset = static_cast<int>(points.size()),
            surface_offset = static_cast<int>(surfaces.size());
  for (const Eigen::Vector3f& x : other.points) {
    points.push_back((this_from_other * x.cast<double>().eval()).cast<float>());
  }
  for (const Eigen::Vector3f& n : other.normals) {
    normals.push_back((this_from_other.rotation * n.cast<double>().eval()).cast<float>());
  }
  uvs.insert(uvs.end(), other.uvs.begin(), other.uvs.end());
  surfaces.insert(surfaces.end(), other.surfaces.begin(), other.surfaces.end());
  for (Corners corners : other.triangles) {
    for (int& point : corners.point) point += point_offset;
    corners.surface += surface_offset;
    triangles.push_back(corners);
  }
}

float Mesh::Radius() const {
  float radius = 0;
  for (const Eigen::Vector3f& x : points) radius = std::max(radius, x.norm());
  return radius;
}

}  // namespace dynamic_slam
