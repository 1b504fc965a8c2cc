#include "dynamic_slam/sim/scene.h"

namespace dynamic_slam {

void AddBox(Scene& scene, uint64_t seed, const Rigid3& world_from_box, const Eigen::Vector3d& size_m,
            bool inside_out, double texels_per_m) {
  // Outward normal of each face, and where down is on its texture, for one who stands outside.
  struct Face {
    Eigen::Vector3d normal, down;
    double brightness;
  };
  const Face faces[] = {{{1, 0, 0}, {0, 0, -1}, 1.0},  {{-1, 0, 0}, {0, 0, -1}, 0.9},
                        {{0, 1, 0}, {0, 0, -1}, 0.95}, {{0, -1, 0}, {0, 0, -1}, 0.85},
                        {{0, 0, 1}, {0, 1, 0}, 1.05},  {{0, 0, -1}, {0, 1, 0}, 0.75}};
  uint64_t part = 0;
  for (const Face& face : faces) {
    // Looking along -normal, right is down x (-normal); from inside, left and right change places.
    const Eigen::Vector3d right = (inside_out ? 1.0 : -1.0) * face.down.cross(face.normal);
    const Eigen::Vector3d edge_x = right.cwiseProduct(size_m), edge_y = face.down.cwiseProduct(size_m);
    const Eigen::Vector3d corner = 0.5 * (face.normal.cwiseProduct(size_m) - edge_x - edge_y);
    TexturedQuad quad;
    quad.corner = world_from_box * corner;
    quad.edge_x = world_from_box.rotation * edge_x;
    quad.edge_y = world_from_box.rotation * edge_y;
    quad.texture = std::make_shared<Texture>(
        MakeRichTexture(SubSeed(seed, part++), edge_x.norm(), edge_y.norm(), texels_per_m));
    quad.brightness = face.brightness;
    scene.quads.push_back(quad);
  }
}

}  // namespace dynamic_slam
