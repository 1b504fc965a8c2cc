#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/sim/color_texture.h"

namespace dynamic_slam {

// What a triangle is covered with.
struct Surface {
  std::shared_ptr<const ColorTexture> texture;
  Eigen::Vector3f tint = Eigen::Vector3f::Ones();  // factor on blue, green, red
  float detail_repeat = 0;  // how often the fine grain of everything repeats in one texture; 0: none
  bool two_sided = false;
  bool shines = false;        // lit by itself: screens, lamps
  bool takes_shadow = false;  // of what stands on it
};

// Triangles in a frame of their own, in metres. A triangle is seen from the side from which its corners run
// counter-clockwise.
struct Mesh {
  struct Corners {
    std::array<int, 3> point;
    int surface;
  };
  std::vector<Eigen::Vector3f> points, normals;  // normals: outward, unit length, one for each point
  std::vector<Eigen::Vector2f> uvs;              // texture coordinates, v down
  std::vector<Corners> triangles;
  std::vector<Surface> surfaces;

  int AddSurface(const Surface& surface);
  int AddPoint(const Eigen::Vector3d& x, const Eigen::Vector3d& normal, const Eigen::Vector2d& uv);

  // corner + s * edge_x + t * edge_y, s and t in [0, 1], seen from where edge_x points right and edge_y down;
  // the texture's x runs along edge_x. `uv`: texture coordinates of the far corner, of the near one `uv0`.
  void AddQuad(int surface, const Eigen::Vector3d& corner, const Eigen::Vector3d& edge_x,
               const Eigen::Vector3d& edge_y, const Eigen::Vector2d& uv = {1, 1},
               const Eigen::Vector2d& uv0 = {0, 0});

  // The faces of a box about `centre`, turned by `yaw_rad` about z, seen from outside. The texture repeats
  // every `texture_m` metres; 0: once on each face.
  void AddBox(int surface, const Eigen::Vector3d& centre, const Eigen::Vector3d& size, double yaw_rad = 0,
              double texture_m = 0);

  // A smooth closed surface through ellipses that follow one another along an axis: u runs around, v from the
  // first to the last. The ends are closed to points.
  struct Ring {
    Eigen::Vector3d centre;
    double radius_x, radius_y;  // along `across_x` and `across_y` of AddLoft
  };
  void AddLoft(int surface, std::span<const Ring> rings, const Eigen::Vector3d& across_x,
               const Eigen::Vector3d& across_y, int sides);
  // A ball with three radii, the poles along z.
  void AddEllipsoid(int surface, const Eigen::Vector3d& centre, const Eigen::Vector3d& radii, int sides = 12,
                    int rings = 7);

  void Add(const Mesh& other, const Rigid3& this_from_other);

  // Radius of a ball about the origin that holds all points.
  float Radius() const;
};

}  // namespace dynamic_slam
