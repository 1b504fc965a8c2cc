#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/io/image_preparer.h"
#include "dynamic_slam/map/map.h"
#include "dynamic_slam/mapping/local_mapper.h"
#include "dynamic_slam/system/system_options.h"
#include "dynamic_slam/tracking/tracker.h"

namespace dynamic_slam {

// What became of one image, and how long it took.
struct FrameResult {
  FrameId id;
  TrackingResult tracking;
  double tracking_ms = 0;  // from the image in memory to its pose
  double mapping_ms = 0;   // of the mapping that ran because of it
};

// Dynamic-SLAM in offline mode: every frame, one thread, one fixed order of the stages, so that the same
// images, options and binary give the same map bit by bit.
class SlamSystem {
 public:
  // raw_camera: of the images that Process takes. Throws InputError when it or an option is out of range.
  SlamSystem(const Camera& raw_camera, const SystemOptions& options);

  // image: of the raw camera's size, any type that ImagePreparer takes. mask: empty, or CV_8UC1 of camera()'s
  // size, not 0 where keypoints are forbidden, beside those of the static mask. Throws InputError, and
  // changes nothing, when the image cannot be prepared.
  FrameResult Process(double timestamp_s, const cv::Mat& image, const cv::Mat& mask = {});

  // To be called once after the last image; adjusts the whole map. Poses and landmarks are final after it.
  void Finish();

  // The frames that have a pose, at where the map puts them now.
  Trajectory FrameTrajectory() const;
  Trajectory KeyframeTrajectory() const;

  // Frames of FrameTrajectory that had their pose when their turn came.
  size_t LiveFrameCount() const;

  const Map& map() const { return map_; }
  const ImagePreparer& preparer() const { return preparer_; }
  const Camera& camera() const { return preparer_.camera(); }  // of the prepared images
  const SystemOptions& options() const { return options_; }

 private:
  // Where a frame was, relative to a keyframe: survives whatever happens to the map.
  struct TrackedFrame {
    double timestamp_s;
    KeyframeId reference;
    Rigid3 cam_from_reference;
    bool is_live;  // not given its pose by a later frame
  };

  SystemOptions options_;
  ImagePreparer preparer_;
  Map map_;
  Tracker tracker_;
  LocalMapper mapper_;
  std::vector<TrackedFrame> tracked_;
  uint32_t frame_count_ = 0;
  cv::Mat grey_;  // the image in work
};

}  // namespace dynamic_slam
