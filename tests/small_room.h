#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/random.h"
#include "dynamic_slam/sim/room.h"
#include "dynamic_slam/system/system_options.h"

namespace dynamic_slam {

// A short film of the rendered room that is cheap to run many times: 320x240 px, few keypoints.
struct SmallRoom {
  static constexpr int kFrames = 28;

  SmallRoom() : room(Options()) {
    for (int i = 0; i < kFrames; ++i) images.push_back(room.Frame(i));
  }
  // Rendered once in each process.
  static const SmallRoom& Get() {
    static const SmallRoom& small_room = *new SmallRoom;
    return small_room;
  }

  static Camera SmallCamera() {
    Camera camera = DefaultRoomCamera();
    camera.width = 320;
    camera.height = 240;
    camera.fx = camera.fy = 260;
    camera.cx = 159.5;
    camera.cy = 119.5;
    camera.fps = 10;  // enough parallax after a few frames
    return camera;
  }
  static RoomOptions Options() {
    RoomOptions options;
    options.camera = SmallCamera();
    options.frames = kFrames;
    return options;
  }
  static SystemOptions CheapOptions() {
    SystemOptions options;
    options.orb.features = 250;
    options.orb.levels = 4;
    options.tracker.initializer.feature_factor = 2;
    options.tracker.initializer.two_view.max_ransac_iterations = 100;
    options.tracker.keyframe.max_frames = 3;  // mapping always has something to do
    return options;
  }
  static cv::Mat BlackImage() { return cv::Mat::zeros(240, 320, CV_8UC1); }
  // Full of corners, none of them the room's.
  static cv::Mat NoiseImage(int seed) {
    Random random(static_cast<uint64_t>(seed));
    cv::Mat image(240, 320, CV_8UC1);
    for (auto pixel = image.begin<uint8_t>(); pixel != image.end<uint8_t>(); ++pixel)
      *pixel = static_cast<uint8_t>(random.Index(256));
    return image;
  }

  double Stamp(int frame) const { return room.truth()[static_cast<size_t>(frame)].timestamp_s; }
  const cv::Mat& image(int frame) const { return images[static_cast<size_t>(frame)]; }

  Room room;
  std::vector<cv::Mat> images;
};

}  // namespace dynamic_slam
