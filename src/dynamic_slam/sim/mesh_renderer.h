#pragma once

#include <memory>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/sim/mesh.h"

namespace dynamic_slam {

constexpr int kNoObject = -1;
constexpr float kNearestDrawn = 0.06f;  // m; nothing nearer is seen

// A mesh at a place.
struct MeshInstance {
  std::shared_ptr<const Mesh> mesh;
  Rigid3 world_from_mesh;
  int object = kNoObject;      // what the picture of objects says of it
  float radius_m = 0;          // of a ball about the mesh's origin
  float max_distance_m = 1e9;  // drawn no farther than this

  MeshInstance(std::shared_ptr<const Mesh> mesh_in, const Rigid3& world_from_mesh_in,
               int object_in = kNoObject, float max_distance_m_in = 1e9)
      : mesh(std::move(mesh_in)),
        world_from_mesh(world_from_mesh_in),
        object(object_in),
        radius_m(mesh->Radius()),
        max_distance_m(max_distance_m_in) {}
};

// A soft dark ellipse on the floor, z = 0: where axis_x and axis_y end the shade ends.
struct GroundShadow {
  Eigen::Vector2f centre, axis_x, axis_y;  // m, axes orthogonal
};

struct Lighting {
  Eigen::Vector3d to_sun{0.3, 0.4, 0.85};           // direction
  float ambient = 0.55f, sun = 0.35f, sky = 0.15f;  // sky: from above
  std::shared_ptr<const ColorTexture>
      backdrop;  // seen where nothing else is: u around, v from zenith to below
};

// What a camera sees at one moment.
struct RenderedView {
  cv::Mat3f image;    // blue, green, red, 0 to 255
  cv::Mat1f depth_m;  // along the optical axis; 0: nothing
  cv::Mat1i objects;  // kNoObject, or the object that most of the pixel shows
};

// Draws meshes as one camera sees them. Rays are exact, lens distortion included: triangles are found by
// their 2-D homogeneous edge functions (Olano and Greer, "Triangle scan conversion using 2D homogeneous
// coordinates", 1997) at the rays of the distorted pixels, so nothing is warped afterwards. Four samples a
// pixel decide what is nearest; each surface among them is shaded once, with mip levels along and across the
// view.
class MeshRenderer {
 public:
  explicit MeshRenderer(const Camera& camera);

  const Camera& camera() const { return camera_; }

  // Throws nothing; may be called from several threads at once.
  RenderedView Render(const std::vector<const MeshInstance*>& instances,
                      const std::vector<GroundShadow>& shadows, const Lighting& lighting,
                      const Rigid3& world_from_cam) const;

  // The share of the object's whole silhouette, inside the image and beyond it, that `view` shows, 0 to 1.
  double VisibleShare(const std::vector<const MeshInstance*>& instances, int object, const RenderedView& view,
                      const Rigid3& world_from_cam) const;

 private:
  struct Triangle;
  struct Context;

  void Project(const MeshInstance& instance, const Lighting& lighting, const Rigid3& cam_from_world,
               std::vector<Triangle>* triangles) const;
  cv::Rect PixelBox(const Eigen::Vector3f* corners) const;
  cv::v_float32x4 Shade(const Context& context, const Triangle& triangle, float ray_x, float ray_y) const;
  cv::v_float32x4 ShadeOutline(const Context& context, const std::vector<Triangle>& triangles, const int* ids,
                               float x, float y, int* main_id) const;
  cv::v_float32x4 ShadeBackdrop(const Context& context, float ray_x, float ray_y) const;

  Camera camera_;
  cv::Mat1f ray_x_, ray_y_;                // ideal normalised coordinates of each pixel's centre
  float low_x_, low_y_, high_x_, high_y_;  // bounds of all rays
  ColorTexture grain_;                     // fine structure of everything, mean 128
};

}  // namespace dynamic_slam
