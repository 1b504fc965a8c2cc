#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/sim/texture.h"

namespace dynamic_slam {

// A parallelogram in the world: corner + s * edge_x + t * edge_y with s, t in [0, 1]. The texture's x runs
// along edge_x and its y along edge_y. It is seen from the side from which edge_x points right and edge_y
// points down.
struct TexturedQuad {
  Eigen::Vector3d corner, edge_x, edge_y;  // m
  std::shared_ptr<const Texture> texture;
  double brightness = 1.0;  // factor on the texture's grey values

  // World point of a texture point, in texels as for Texture::Sample.
  Eigen::Vector3d PointOfTexel(double x, double y) const {
    return corner + x / texture->width() * edge_x + y / texture->height() * edge_y;
  }
};

// Everything that can be seen.
struct Scene {
  std::vector<TexturedQuad> quads;
};

// Adds the six faces of a box. `world_from_box`: box frame with its origin in the centre, z up; `size_m`:
// full edge lengths. Seen from outside, or with `inside_out` from inside (a room). Each face gets its own
// rich texture.
void AddBox(Scene& scene, uint64_t seed, const Rigid3& world_from_box, const Eigen::Vector3d& size_m,
            bool inside_out, double texels_per_m);

}  // namespace dynamic_slam
