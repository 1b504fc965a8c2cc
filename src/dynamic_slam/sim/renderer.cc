#include "dynamic_slam/sim/renderer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <Eigen/LU>

#include "dynamic_slam/sim/fast_log2.h"

namespace dynamic_slam {

// A quad in the camera's frame. For a ray d = (x, y, 1), (a, b, c) = inverse * d gives the place on the quad,
// s = a / c and t = b / c, and the inverse depth c: from d = (s * edge_x + t * edge_y + corner) * c.
struct Renderer::View {
  Eigen::Matrix3f inverse;
  const TexturedQuad* quad;
  float width, height;  // of the texture, texels
  cv::Rect box;         // of pixels that may see it

  Eigen::Vector3f At(float ray_x, float ray_y) const { return inverse * Eigen::Vector3f(ray_x, ray_y, 1.0f); }
  static bool Inside(const Eigen::Vector3f& abc) {
    return abc[0] >= 0 && abc[1] >= 0 && abc[0] <= abc[2] && abc[1] <= abc[2] && abc[2] > 0;
  }
};

namespace {

constexpr float kMaxInverseDepth = 20;  // 1/m; nearer than 5 cm nothing is drawn

// The pixels that may see the quad: the box of its corners, or the whole image when a corner is beside or
// behind the camera or the lens bends straight lines.
cv::Rect PixelBox(const Camera& camera, const Rigid3& cam_from_world, const TexturedQuad& quad) {
  const cv::Rect whole(0, 0, camera.width, camera.height);
  if (camera.HasDistortion()) return whole;
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  for (const auto& [s, t] : {std::pair{0, 0}, {0, 1}, {1, 0}, {1, 1}}) {
    const Eigen::Vector3d x = cam_from_world * (quad.corner + s * quad.edge_x + t * quad.edge_y);
    if (x.z() < 0.1) return whole;
    const Eigen::Vector2d px = camera.Project(x);
    low = low.cwiseMin(px);
    high = high.cwiseMax(px);
  }
  low = low.cwiseMax(Eigen::Vector2d(-1, -1));
  high = high.cwiseMin(Eigen::Vector2d(camera.width, camera.height));
  if ((high - low).minCoeff() < 0) return {};
  const cv::Point first(static_cast<int>(std::floor(low.x())), static_cast<int>(std::floor(low.y())));
  const cv::Point last(static_cast<int>(std::ceil(high.x())), static_cast<int>(std::ceil(high.y())));
  return cv::Rect(first, last + cv::Point(1, 1)) & whole;
}

// One row of pixels against one quad. Without branches and aliasing, so that the compiler makes vectors of
// it.
void UpdateNearest(const Eigen::Matrix3f& m, int id, int count, const float* __restrict x,
                   const float* __restrict y, float* __restrict best, int* __restrict best_id) {
  const float m00 = m(0, 0), m01 = m(0, 1), m02 = m(0, 2), m10 = m(1, 0), m11 = m(1, 1), m12 = m(1, 2),
              m20 = m(2, 0), m21 = m(2, 1), m22 = m(2, 2);
  for (int i = 0; i < count; ++i) {
    const float a = m00 * x[i] + m01 * y[i] + m02;
    const float b = m10 * x[i] + m11 * y[i] + m12;
    const float c = m20 * x[i] + m21 * y[i] + m22;
    // Each bound as a distance that is not negative: one minimum instead of six comparisons.
    const float inside = std::min(std::min(std::min(a, b), std::min(c - a, c - b)), kMaxInverseDepth - c);
    const bool wins = (inside >= 0) & (c > best[i]);
    best[i] = wins ? c : best[i];
    best_id[i] = wins ? id : best_id[i];
  }
}

}  // namespace

Renderer::Renderer(const Camera& camera)
    : camera_(camera), ray_x_(camera.height, camera.width), ray_y_(camera.height, camera.width) {
  camera.Validate();
  for (int row = 0; row < camera.height; ++row) {
    for (int column = 0; column < camera.width; ++column) {
      const Eigen::Vector3d ray = camera.Unproject(camera.Undistort(Eigen::Vector2d(column, row)));
      ray_x_(row, column) = static_cast<float>(ray.x());
      ray_y_(row, column) = static_cast<float>(ray.y());
    }
  }
}

cv::Mat Renderer::Render(const Scene& scene, const Rigid3& world_from_cam) const {
  const Rigid3 cam_from_world = world_from_cam.Inverse();
  std::vector<View> views;
  for (const TexturedQuad& quad : scene.quads) {
    Eigen::Matrix3d M;
    M << cam_from_world.rotation * quad.edge_x, cam_from_world.rotation * quad.edge_y,
        cam_from_world * quad.corner;
    if (M.determinant() <= 1e-9) continue;  // seen from behind, or edge-on
    const cv::Rect box = PixelBox(camera_, cam_from_world, quad);
    if (box.empty()) continue;
    views.push_back({M.inverse().cast<float>(), &quad, static_cast<float>(quad.texture->width()),
                     static_cast<float>(quad.texture->height()), box});
  }

  const cv::Mat1i nearest = NearestQuads(views);
  cv::Mat1b image(camera_.height, camera_.width, uint8_t{0});
  for (int row = 0; row < image.rows; ++row) {
    const int *above = nearest[std::max(row - 1, 0)], *here = nearest[row];
    const int* below = nearest[std::min(row + 1, image.rows - 1)];
    for (int column = 0; column < image.cols; ++column) {
      const int left = std::max(column - 1, 0), right = std::min(column + 1, image.cols - 1);
      const int id = here[column];
      const bool one_quad =
          id == here[left] && id == here[right] && id == above[column] && id == below[column];
      float grey = 0;
      if (!one_quad) {
        grey = ShadeOutline(views, nearest, column, row);
      } else if (id >= 0) {
        grey = Shade(views[id], ray_x_(row, column), ray_y_(row, column));
      }
      image(row, column) = cv::saturate_cast<uint8_t>(grey);
    }
  }
  return image;
}

cv::Mat1i Renderer::NearestQuads(const std::vector<View>& views) const {
  cv::Mat1i nearest(camera_.height, camera_.width, -1);
  cv::Mat1f inverse_depth(camera_.height, camera_.width, 0.0f);
  for (size_t i = 0; i < views.size(); ++i) {
    const Eigen::Matrix3f m = views[i].inverse;
    const cv::Rect box = views[i].box;
    for (int row = box.y; row < box.y + box.height; ++row) {
      UpdateNearest(m, static_cast<int>(i), box.width, &ray_x_(row, box.x), &ray_y_(row, box.x),
                    &inverse_depth(row, box.x), &nearest(row, box.x));
    }
  }
  return nearest;
}

float Renderer::Shade(const View& view, float ray_x, float ray_y) const {
  const Eigen::Vector3f abc = view.At(ray_x, ray_y);
  const float depth = 1.0f / abc[2];
  const float s = abc[0] * depth, t = abc[1] * depth;
  // How far one pixel to the right and one down move on the texture, in texels.
  const Eigen::Matrix3f& m = view.inverse;
  const float to_x = depth / static_cast<float>(camera_.fx), to_y = depth / static_cast<float>(camera_.fy);
  const Eigen::Vector2f right((m(0, 0) - s * m(2, 0)) * to_x * view.width,
                              (m(1, 0) - t * m(2, 0)) * to_x * view.height);
  const Eigen::Vector2f down((m(0, 1) - s * m(2, 1)) * to_y * view.width,
                             (m(1, 1) - t * m(2, 1)) * to_y * view.height);
  const float right_length = right.norm(), down_length = down.norm();
  const Eigen::Vector2f& major = right_length > down_length ? right : down;
  const float longer = std::max(right_length, down_length), shorter = std::min(right_length, down_length);
  const int samples = std::clamp(static_cast<int>(longer / std::max(shorter, 1e-6f) + 0.5f), 1, 6);
  const float footprint = std::max(shorter, longer / static_cast<float>(samples));
  const float level = footprint <= 1.0f ? 0.0f : FastLog2(footprint);
  float sum = 0;
  for (int i = 0; i < samples; ++i) {
    const float step = (static_cast<float>(i) + 0.5f) / static_cast<float>(samples) - 0.5f;
    sum += view.quad->texture->Sample(s * view.width + step * major[0], t * view.height + step * major[1],
                                      level);
  }
  return sum / static_cast<float>(samples) * static_cast<float>(view.quad->brightness);
}

float Renderer::ShadeOutline(const std::vector<View>& views, const cv::Mat1i& nearest, int column,
                             int row) const {
  // The quads that the pixel and its neighbours see are those between which its rays may choose.
  int ids[9];
  int count = 0;
  for (int y = std::max(row - 1, 0); y <= std::min(row + 1, nearest.rows - 1); ++y) {
    for (int x = std::max(column - 1, 0); x <= std::min(column + 1, nearest.cols - 1); ++x) {
      const int id = nearest(y, x);
      if (id >= 0 && std::find(ids, ids + count, id) == ids + count) ids[count++] = id;
    }
  }
  constexpr int kGrid = 4;
  float sum = 0;
  for (int i = 0; i < kGrid * kGrid; ++i) {
    const float dx = (static_cast<float>(i % kGrid) + 0.5f) / kGrid - 0.5f;
    const float dy = (static_cast<float>(i / kGrid) + 0.5f) / kGrid - 0.5f;
    const float x = ray_x_(row, column) + dx / static_cast<float>(camera_.fx);
    const float y = ray_y_(row, column) + dy / static_cast<float>(camera_.fy);
    const View* best = nullptr;
    float best_inverse_depth = 0;
    for (int k = 0; k < count; ++k) {
      const Eigen::Vector3f abc = views[ids[k]].At(x, y);
      if (!View::Inside(abc) || abc[2] <= best_inverse_depth || abc[2] >= kMaxInverseDepth) continue;
      best = &views[ids[k]];
      best_inverse_depth = abc[2];
    }
    if (best != nullptr) sum += Shade(*best, x, y);
  }
  return sum / (kGrid * kGrid);
}

}  // namespace dynamic_slam
