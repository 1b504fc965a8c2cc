#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dynamic_slam/geometry/rigid3.h"
#include "dynamic_slam/tracking/tracking_state.h"

namespace dynamic_slam {

// An object that is believed to be in an image. x, y: its top left corner, px of the prepared image (that of
// System::camera()).
struct ImageObject {
  double x = 0, y = 0, width = 0, height = 0;
  std::string class_name;
  double score = 0;          // trust in it, 0 to 1
  int track_id = 0;          // the same object in other images
  bool is_detected = false;  // by the detector in this image; else carried on from earlier ones
  bool is_dynamic = false;   // of a kind that moves, by what the detector said of it so far
};

// What became of one image.
struct ImageResult {
  double timestamp_s = 0;
  TrackingState state = TrackingState::kInitialising;
  std::string reason;  // why there is no pose, in one sentence with its number; or that the map was begun
  // Where the map puts the camera now; Finish, loops and later images may still move it.
  std::optional<Rigid3> world_from_cam;
  int keypoints = 0;
  int inliers = 0;  // landmarks that fit the pose
  bool is_keyframe = false;
  std::vector<ImageObject> objects;
  double tracking_ms = 0;  // from the image in memory to its pose
};

}  // namespace dynamic_slam
