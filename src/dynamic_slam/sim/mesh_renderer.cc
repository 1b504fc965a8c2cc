#include "dynamic_slam/sim/mesh_renderer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/dispatch.h"
#include "dynamic_slam/sim/color_materials.h"
#include "dynamic_slam/sim/fast_log2.h"

namespace dynamic_slam {

// Linear functions of a ray (x, y, 1) in the camera's frame: each row, times the ray, is a barycentric
// coordinate or an attribute, divided by depth.
struct MeshRenderer::Triangle {
  Eigen::Matrix3f edges;  // rows: barycentric coordinates / depth
  Eigen::RowVector3f inverse_depth, u, v, light;
  const Surface* surface;
  int object;
  cv::Rect box;  // of pixels that may see it
};

struct MeshRenderer::Context {
  const std::vector<GroundShadow>& shadows;
  const Lighting& lighting;
  Eigen::Matrix3f world_from_cam;
  Eigen::Vector3f centre_in_world;
};

namespace {

constexpr int kBandRows = 16;  // at a time, so that the samples stay in the cache
constexpr int kSamples = 4;
// Where in a pixel the samples are: a rotated square, no two in one row or column.
constexpr float kSampleX[kSamples] = {-0.125f, 0.375f, 0.125f, -0.375f};
constexpr float kSampleY[kSamples] = {-0.375f, -0.125f, 0.375f, 0.125f};

// A row of pixels against one triangle: for each of the samples, the largest inverse depth and whose it is.
// Without branches, so that the compiler makes vectors of it; AVX2 has no fused operations, so both versions
// give the same bits.
DS_DISPATCH_AVX2 void CoverRow(const float* __restrict m, const float* __restrict offsets, int id, int count,
                               const float* __restrict x, const float* __restrict y, float* __restrict best,
                               int* __restrict best_id) {
  const float m0 = m[0], m1 = m[1], m2 = m[2], m3 = m[3], m4 = m[4], m5 = m[5], m6 = m[6], m7 = m[7],
              m8 = m[8];
  // A little over the edges: neighbours round differently, and nothing may shine through between them.
  constexpr float kSlack = -1e-4f;
  const float o0 = offsets[0], o1 = offsets[1], o2 = offsets[2];
  for (int i = 0; i < count; ++i) {
    const float a = m0 * x[i] + m1 * y[i] + m2 + o0;
    const float b = m3 * x[i] + m4 * y[i] + m5 + o1;
    const float c = m6 * x[i] + m7 * y[i] + m8 + o2;
    const float z = a + b + c;
    const float inside = std::min(std::min(a, b), std::min(c, 1.0f / kNearestDrawn - z));
    const bool wins = (inside >= kSlack * z) & (z > best[i]);
    best[i] = wins ? z : best[i];
    best_id[i] = wins ? id : best_id[i];
  }
}

float Dot(const Eigen::RowVector3f& row, float x, float y) { return row[0] * x + row[1] * y + row[2]; }

// Bits for the planes that a point is outside of.
int OutCode(const Eigen::Vector3f& x, float low_x, float low_y, float high_x, float high_y) {
  return (x.z() < kNearestDrawn) | (x.x() < low_x * x.z()) << 1 | (x.x() > high_x * x.z()) << 2 |
         (x.y() < low_y * x.z()) << 3 | (x.y() > high_y * x.z()) << 4;
}

}  // namespace

MeshRenderer::MeshRenderer(const Camera& camera)
    : camera_(camera),
      ray_x_(camera.height, camera.width),
      ray_y_(camera.height, camera.width),
      grain_(DrawGrain()) {
  camera.Validate();
  for (int row = 0; row < camera.height; ++row) {
    for (int column = 0; column < camera.width; ++column) {
      const Eigen::Vector3d ray = camera.Unproject(camera.Undistort(Eigen::Vector2d(column, row)));
      ray_x_(row, column) = static_cast<float>(ray.x());
      ray_y_(row, column) = static_cast<float>(ray.y());
    }
  }
  double low = 0, high = 0;
  cv::minMaxLoc(ray_x_, &low, &high);
  low_x_ = static_cast<float>(low) - 0.003f;
  high_x_ = static_cast<float>(high) + 0.003f;
  cv::minMaxLoc(ray_y_, &low, &high);
  low_y_ = static_cast<float>(low) - 0.003f;
  high_y_ = static_cast<float>(high) + 0.003f;
}

// The pixels that may see the triangle: the box of its outline, cut at the borders of what the camera sees.
cv::Rect MeshRenderer::PixelBox(const Eigen::Vector3f* corners) const {
  Eigen::Vector3f ring[9] = {corners[0], corners[1], corners[2]};
  int count = 3;
  const auto cut = [&](auto inside) {  // Sutherland and Hodgman's
    Eigen::Vector3f kept[9];
    int kept_count = 0;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3f &from = ring[i], &to = ring[(i + 1) % count];
      const float a = inside(from), b = inside(to);
      if (a >= 0) kept[kept_count++] = from;
      if ((a >= 0) != (b >= 0)) kept[kept_count++] = from + (to - from) * (a / (a - b));
    }
    std::copy(kept, kept + kept_count, ring);
    count = kept_count;
  };
  int codes = 0;
  for (int i = 0; i < 3; ++i) codes |= OutCode(corners[i], low_x_, low_y_, high_x_, high_y_);
  if (codes & 1) cut([](const Eigen::Vector3f& x) { return x.z() - kNearestDrawn; });
  if (codes & 2) cut([this](const Eigen::Vector3f& x) { return x.x() - low_x_ * x.z(); });
  if (codes & 4) cut([this](const Eigen::Vector3f& x) { return high_x_ * x.z() - x.x(); });
  if (codes & 8) cut([this](const Eigen::Vector3f& x) { return x.y() - low_y_ * x.z(); });
  if (codes & 16) cut([this](const Eigen::Vector3f& x) { return high_y_ * x.z() - x.y(); });
  if (count == 0) return {};
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  const auto add = [&](const Eigen::Vector2d& ideal_px) {
    const Eigen::Vector2d px = camera_.HasDistortion() ? camera_.Distort(ideal_px) : ideal_px;
    low = low.cwiseMin(px);
    high = high.cwiseMax(px);
  };
  Eigen::Vector2d ideal[9];
  for (int i = 0; i < count; ++i) ideal[i] = camera_.Project(ring[i].cast<double>());
  for (int i = 0; i < count; ++i) {
    add(ideal[i]);
    if (!camera_.HasDistortion()) continue;
    // The lens bends the edge.
    const Eigen::Vector2d& next = ideal[(i + 1) % count];
    const int steps = static_cast<int>((next - ideal[i]).norm() / 30);
    for (int k = 1; k <= steps; ++k) add(ideal[i] + (next - ideal[i]) * k / (steps + 1));
  }
  // One more where edges are bent: the samples of a pixel reach half a pixel out.
  const double margin = camera_.HasDistortion() ? 1.5 : 0.5;
  const int left = std::max(static_cast<int>(std::floor(low.x() - margin)), 0);
  const int top = std::max(static_cast<int>(std::floor(low.y() - margin)), 0);
  const int right = std::min(static_cast<int>(std::ceil(high.x() + margin)), camera_.width - 1);
  const int bottom = std::min(static_cast<int>(std::ceil(high.y() + margin)), camera_.height - 1);
  return right < left || bottom < top ? cv::Rect() : cv::Rect(left, top, right - left + 1, bottom - top + 1);
}

void MeshRenderer::Project(const MeshInstance& instance, const Lighting& lighting,
                           const Rigid3& cam_from_world, std::vector<Triangle>* triangles) const {
  const Rigid3 cam_from_mesh = cam_from_world * instance.world_from_mesh;
  const Eigen::Vector3d& centre = cam_from_mesh.translation;
  const double radius = instance.radius_m;
  if (centre.z() + radius < kNearestDrawn || centre.norm() - radius > instance.max_distance_m) return;
  // Outside one of the four planes through the optical centre.
  const auto outside = [&](double a, double b, double slope) {  // a < slope * b
    return (a - slope * b) / std::sqrt(1 + slope * slope) > radius;
  };
  if (outside(-centre.x(), -centre.z(), low_x_) || outside(centre.x(), centre.z(), high_x_) ||
      outside(-centre.y(), -centre.z(), low_y_) || outside(centre.y(), centre.z(), high_y_)) {
    return;
  }
  const Mesh& mesh = *instance.mesh;
  const Eigen::Matrix3f rotation = cam_from_mesh.Matrix().cast<float>();
  const Eigen::Vector3f translation = centre.cast<float>();
  const Eigen::Vector3f to_sun =
      (instance.world_from_mesh.rotation.conjugate() * lighting.to_sun.normalized()).cast<float>();
  const Eigen::Vector3f up =
      (instance.world_from_mesh.rotation.conjugate() * Eigen::Vector3d::UnitZ()).cast<float>();
  std::vector<Eigen::Vector3f> points(mesh.points.size());
  std::vector<uint8_t> codes(mesh.points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    points[i] = rotation * mesh.points[i] + translation;
    codes[i] = static_cast<uint8_t>(OutCode(points[i], low_x_, low_y_, high_x_, high_y_));
  }
  const auto light = [&](const Eigen::Vector3f& normal) {
    return lighting.ambient + lighting.sun * std::max(0.0f, normal.dot(to_sun)) +
           lighting.sky * (0.5f + 0.5f * normal.dot(up));
  };
  for (const Mesh::Corners& corners : mesh.triangles) {
    std::array<int, 3> id = corners.point;
    if (codes[id[0]] & codes[id[1]] & codes[id[2]]) continue;
    const Surface& surface = mesh.surfaces[corners.surface];
    Eigen::Matrix3d M;
    const auto fill = [&] {
      M << points[id[0]].cast<double>(), points[id[1]].cast<double>(), points[id[2]].cast<double>();
    };
    fill();
    const double volume = M.determinant();
    if (volume >= -1e-12 && !(surface.two_sided && volume > 1e-12)) continue;  // from behind, or edge-on
    const Eigen::Vector3f ring[] = {points[id[0]], points[id[1]], points[id[2]]};
    const cv::Rect box = PixelBox(ring);
    if (box.empty()) continue;
    Triangle& t = triangles->emplace_back();
    t.edges = M.inverse().cast<float>();
    t.inverse_depth = t.edges.colwise().sum();
    const auto mix = [&](float a, float b, float c) -> Eigen::RowVector3f {
      return a * t.edges.row(0) + b * t.edges.row(1) + c * t.edges.row(2);
    };
    const auto &uv0 = mesh.uvs[id[0]], &uv1 = mesh.uvs[id[1]], &uv2 = mesh.uvs[id[2]];
    t.u = mix(uv0.x(), uv1.x(), uv2.x());
    t.v = mix(uv0.y(), uv1.y(), uv2.y());
    const auto lit = [&](int k) { return surface.shines ? 1.0f : light(mesh.normals[id[k]]); };
    t.light = mix(lit(0), lit(1), lit(2));
    t.surface = &surface;
    t.object = instance.object;
    t.box = box;
  }
}

cv::v_float32x4 MeshRenderer::Shade(const Context& context, const Triangle& t, float ray_x,
                                    float ray_y) const {
  const float depth = 1.0f / Dot(t.inverse_depth, ray_x, ray_y);
  const float u = Dot(t.u, ray_x, ray_y) * depth, v = Dot(t.v, ray_x, ray_y) * depth;
  float light = Dot(t.light, ray_x, ray_y) * depth;
  const Surface& surface = *t.surface;
  const ColorTexture& texture = *surface.texture;
  // How far one pixel to the right and one down move on the texture, in texels.
  const float to_x = depth / static_cast<float>(camera_.fx), to_y = depth / static_cast<float>(camera_.fy);
  const float width = static_cast<float>(texture.width()), height = static_cast<float>(texture.height());
  const float right_u = (t.u[0] - u * t.inverse_depth[0]) * to_x,
              right_v = (t.v[0] - v * t.inverse_depth[0]) * to_x;
  const float down_u = (t.u[1] - u * t.inverse_depth[1]) * to_y,
              down_v = (t.v[1] - v * t.inverse_depth[1]) * to_y;
  const auto length = [](float a, float b) { return std::sqrt(a * a + b * b); };
  const float right = length(right_u * width, right_v * height);
  const float down = length(down_u * width, down_v * height);
  const float longer = std::max(right, down), shorter = std::min(right, down);
  // Several along the longer side where the surface is seen at a grazing angle, unless texels are larger than
  // pixels.
  const int samples =
      longer <= 1.5f ? 1 : std::clamp(static_cast<int>(0.6f * longer / std::max(shorter, 1.0f) + 0.6f), 1, 4);
  const float footprint = std::max(shorter, longer / static_cast<float>(samples));
  const float level = footprint <= 1.0f ? 0.0f : FastLog2(footprint);
  const float major_u = right > down ? right_u : down_u, major_v = right > down ? right_v : down_v;
  cv::v_float32x4 sum = cv::v_setzero_f32();
  for (int i = 0; i < samples; ++i) {
    const float step = (static_cast<float>(i) + 0.5f) / static_cast<float>(samples) - 0.5f;
    sum += texture.Sample(u + step * major_u, v + step * major_v, level);
  }
  if (surface.detail_repeat > 0) {
    const float repeat = surface.detail_repeat;
    const float grain_footprint =
        std::max(right / width, down / height) * repeat * static_cast<float>(grain_.width());
    const float grain_level = grain_footprint <= 1.0f ? 0.0f : FastLog2(grain_footprint);
    if (grain_level < 5.5f)
      light *= grain_.SampleFirst(u * repeat, v * repeat, static_cast<int>(grain_level + 0.5f)) / 128.0f;
  }
  if (surface.takes_shadow) {
    const Eigen::Vector3f x = context.centre_in_world +
                              context.world_from_cam * Eigen::Vector3f(ray_x * depth, ray_y * depth, depth);
    for (const GroundShadow& shadow : context.shadows) {
      const Eigen::Vector2f offset = x.head<2>() - shadow.centre;
      const float a = offset.dot(shadow.axis_x) / shadow.axis_x.squaredNorm();
      const float b = offset.dot(shadow.axis_y) / shadow.axis_y.squaredNorm();
      const float inside = 1.0f - a * a - b * b;
      if (inside > 0) light *= 1.0f - 0.55f * inside * (2.0f - inside);
    }
  }
  const cv::v_float32x4 tint(surface.tint[0], surface.tint[1], surface.tint[2], 0);
  return sum * tint * cv::v_setall_f32(light / static_cast<float>(samples));
}

cv::v_float32x4 MeshRenderer::ShadeBackdrop(const Context& context, float ray_x, float ray_y) const {
  if (context.lighting.backdrop == nullptr) return cv::v_setzero_f32();
  const Eigen::Vector3f ray = (context.world_from_cam * Eigen::Vector3f(ray_x, ray_y, 1)).normalized();
  const float u = std::atan2(ray.y(), ray.x()) / (2 * std::numbers::pi_v<float>);
  const float v = std::acos(std::clamp(ray.z(), -1.0f, 1.0f)) / std::numbers::pi_v<float>;
  return context.lighting.backdrop->Sample(u, v, 0);
}

// A pixel that sees more than one triangle. `main_id`: of the triangles, the one with most samples.
cv::v_float32x4 MeshRenderer::ShadeOutline(const Context& context, const std::vector<Triangle>& triangles,
                                           const int* ids, float x, float y, int* main_id) const {
  cv::v_float32x4 color = cv::v_setzero_f32();
  int most = 0;
  unsigned done = 0;
  for (int s = 0; s < kSamples; ++s) {
    if (done >> s & 1) continue;
    // The samples that see the same surface of the same object are shaded once, at their mean place.
    int count = 0;
    float dx = 0, dy = 0;
    for (int k = s; k < kSamples; ++k) {
      const bool same = ids[k] == ids[s] || (ids[k] >= 0 && ids[s] >= 0 &&
                                             triangles[ids[k]].surface == triangles[ids[s]].surface &&
                                             triangles[ids[k]].object == triangles[ids[s]].object);
      if (!same) continue;
      done |= 1u << k;
      dx += kSampleX[k];
      dy += kSampleY[k];
      ++count;
    }
    const float share = 1.0f / static_cast<float>(count);
    const float at_x = x + dx * share / static_cast<float>(camera_.fx);
    const float at_y = y + dy * share / static_cast<float>(camera_.fy);
    const cv::v_float32x4 shade =
        ids[s] < 0 ? ShadeBackdrop(context, at_x, at_y) : Shade(context, triangles[ids[s]], at_x, at_y);
    color += shade * cv::v_setall_f32(static_cast<float>(count) / kSamples);
    if (count > most) {
      most = count;
      *main_id = ids[s];
    }
  }
  return color;
}

RenderedView MeshRenderer::Render(const std::vector<const MeshInstance*>& instances,
                                  const std::vector<GroundShadow>& shadows, const Lighting& lighting,
                                  const Rigid3& world_from_cam) const {
  const Rigid3 cam_from_world = world_from_cam.Inverse();
  const Context context{shadows, lighting, world_from_cam.Matrix().cast<float>(),
                        world_from_cam.translation.cast<float>()};
  std::vector<Triangle> triangles;
  for (const MeshInstance* instance : instances) Project(*instance, lighting, cam_from_world, &triangles);

  const int width = camera_.width, height = camera_.height;
  std::vector<std::vector<int>> of_band((height + kBandRows - 1) / kBandRows);
  for (size_t i = 0; i < triangles.size(); ++i) {
    const cv::Rect& box = triangles[i].box;
    for (int band = box.y / kBandRows; band <= (box.y + box.height - 1) / kBandRows; ++band) {
      of_band[band].push_back(static_cast<int>(i));
    }
  }

  RenderedView view{cv::Mat3f(height, width), cv::Mat1f(height, width), cv::Mat1i(height, width)};
  cv::Mat1f inverse_depth(kBandRows * kSamples, width);
  cv::Mat1i nearest(kBandRows * kSamples, width);
  for (size_t band = 0; band < of_band.size(); ++band) {
    const int first_row = static_cast<int>(band) * kBandRows,
              end_row = std::min(first_row + kBandRows, height);
    inverse_depth.setTo(0);
    nearest.setTo(-1);
    for (const int id : of_band[band]) {
      const Triangle& t = triangles[id];
      const float m[9] = {t.edges(0, 0), t.edges(0, 1), t.edges(0, 2), t.edges(1, 0), t.edges(1, 1),
                          t.edges(1, 2), t.edges(2, 0), t.edges(2, 1), t.edges(2, 2)};
      float offsets[kSamples][3];
      for (int s = 0; s < kSamples; ++s) {
        for (int k = 0; k < 3; ++k) {
          offsets[s][k] = m[3 * k] * kSampleX[s] / static_cast<float>(camera_.fx) +
                          m[3 * k + 1] * kSampleY[s] / static_cast<float>(camera_.fy);
        }
      }
      const int end = std::min(t.box.y + t.box.height, end_row);
      for (int row = std::max(t.box.y, first_row); row < end; ++row) {
        for (int s = 0; s < kSamples; ++s) {
          const int line = (row - first_row) * kSamples + s;
          CoverRow(m, offsets[s], id, t.box.width, &ray_x_(row, t.box.x), &ray_y_(row, t.box.x),
                   &inverse_depth(line, t.box.x), &nearest(line, t.box.x));
        }
      }
    }
    for (int row = first_row; row < end_row; ++row) {
      const int line = (row - first_row) * kSamples;
      for (int column = 0; column < width; ++column) {
        const int ids[kSamples] = {nearest(line, column), nearest(line + 1, column),
                                   nearest(line + 2, column), nearest(line + 3, column)};
        const float x = ray_x_(row, column), y = ray_y_(row, column);
        int main_id = ids[0];
        const cv::v_float32x4 color =
            ids[0] == ids[1] && ids[1] == ids[2] && ids[2] == ids[3]
                ? (main_id < 0 ? ShadeBackdrop(context, x, y) : Shade(context, triangles[main_id], x, y))
                : ShadeOutline(context, triangles, ids, x, y, &main_id);
        float values[4];
        cv::v_store(values, color);
        view.image(row, column) = {values[0], values[1], values[2]};
        view.objects(row, column) = main_id < 0 ? kNoObject : triangles[main_id].object;
        const float inverse = main_id < 0 ? 0.0f : Dot(triangles[main_id].inverse_depth, x, y);
        view.depth_m(row, column) = inverse > 0 ? 1.0f / inverse : 0.0f;
      }
    }
  }
  return view;
}

}  // namespace dynamic_slam
