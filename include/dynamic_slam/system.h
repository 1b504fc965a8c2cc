#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/base/export.h"
#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/map_view.h"
#include "dynamic_slam/options.h"
#include "dynamic_slam/results.h"

namespace dynamic_slam {

// Dynamic-SLAM: from the images of one camera to its path and a map of what stands still. All calls come from
// one thread. InputError is what the caller can put right; InternalError, and what OpenCV throws, end the
// run: after it the results so far can be read, and Reset makes the system as new.
class DYNAMIC_SLAM_API System {
 public:
  // camera: of the images that Process takes (io/camera_file.h reads one). Throws InputError when it, an
  // option or a file that the options name is wrong.
  explicit System(const Camera& camera, const Options& options = {});
  ~System();
  System(System&&) noexcept;
  System& operator=(System&&) noexcept;

  // image: of the camera's size, 8 or 16 bits, grey, BGR or BGRA. mask: empty, or CV_8UC1 of camera()'s size,
  // not 0 where nothing is to be looked at. Stamps (s) must grow. Throws InputError, and changes nothing,
  // when the image or its stamp cannot be used.
  ImageResult Process(double timestamp_s, const cv::Mat& image, const cv::Mat& mask = {});

  // To be called after the last image: adjusts the whole map and, offline, finds poses of images that have
  // none yet and smooths the path. No more images after that, unless Reset is called.
  void Finish();

  // Forgets all images and the map, and that of Options::map too.
  void Reset();

  // How many worlds the trajectory falls into (MapView::Part): 0 before there is a map.
  size_t PartCount() const;

  // Poses world_from_cam of images, or of keyframes alone, at where the map puts them now; part 0 has the
  // most images. Empty when there is no such part.
  Trajectory Poses(size_t part = 0) const;
  Trajectory KeyframePoses(size_t part = 0) const;

  MapView Map() const;

  // Throws InputError.
  void SaveMap(const std::filesystem::path& file) const;

  // The value of every option, as YAML that Options::config can name.
  std::string ConfigYaml() const;

  // Of the prepared images: other than that of the images given where options image.* crop or resize.
  const Camera& camera() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dynamic_slam
