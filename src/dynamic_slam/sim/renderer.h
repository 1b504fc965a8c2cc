#pragma once

#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/sim/scene.h"

namespace dynamic_slam {

// Draws scenes as one camera sees them: exact rays (lens distortion included), nearest quad by inverse depth,
// anti-aliased inside textures (mip levels, several samples at grazing angles) and at outlines (16 rays a
// pixel).
class Renderer {
 public:
  explicit Renderer(const Camera& camera);

  const Camera& camera() const { return camera_; }

  // CV_8UC1, the camera's size. What no quad covers is black. Throws nothing.
  cv::Mat Render(const Scene& scene, const Rigid3& world_from_cam) const;

 private:
  struct View;
  // Index of the nearest quad for each pixel, -1 for none.
  cv::Mat1i NearestQuads(const std::vector<View>& views) const;
  float Shade(const View& view, float ray_x, float ray_y) const;
  float ShadeOutline(const std::vector<View>& views, const cv::Mat1i& nearest, int column, int row) const;

  Camera camera_;
  cv::Mat1f ray_x_, ray_y_;  // ideal normalised coordinates of each pixel's centre
};

}  // namespace dynamic_slam
