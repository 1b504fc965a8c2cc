#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/sim/renderer.h"
#include "dynamic_slam/sim/scene.h"

namespace dynamic_slam {

// 640x480 at 30 fps without distortion, as TUM's fr3.
Camera DefaultRoomCamera();

struct RoomOptions {
  uint64_t seed = 1;  // of everything: textures, furniture, path, noise
  int frames = 300;
  Camera camera = DefaultRoomCamera();  // fps must be positive
  double noise_grey = 1.5;              // standard deviation of the pixel noise, grey levels
};

// A static room of 6 x 5 x 3 m with furniture, everything richly textured, filmed by a hand-held camera. The
// same options give the same bytes. World frame: origin in the middle of the floor, z up.
class Room {
 public:
  // Throws InputError for options out of range.
  explicit Room(const RoomOptions& options);

  const RoomOptions& options() const { return options_; }
  const Scene& scene() const { return scene_; }
  // world_from_cam of each frame, exact; stamps are frame / fps, s.
  const Trajectory& truth() const { return truth_; }

  // The frame with this index as the camera delivers it, CV_8UC1.
  cv::Mat Frame(int index) const;

  // What the camera would see from anywhere, without noise, CV_8UC1.
  cv::Mat Render(const Rigid3& world_from_cam) const { return renderer_.Render(scene_, world_from_cam); }

 private:
  RoomOptions options_;
  Scene scene_;
  Renderer renderer_;
  Trajectory truth_;
};

// The frames of a room in memory. The room must outlive the source.
std::unique_ptr<FrameSource> MakeRoomSource(const Room& room);

}  // namespace dynamic_slam
