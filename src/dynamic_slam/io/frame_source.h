#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/base/export.h"
#include "dynamic_slam/geometry/camera.h"

namespace dynamic_slam {

struct SourceImage {
  double timestamp_s = 0;
  cv::Mat image;     // as decoded: grey, BGR or BGRA; ImagePreparer makes it grey
  std::string name;  // file or frame number, for messages
};

// A frame that was skipped, and why.
struct SourceProblem {
  std::string name;
  std::string reason;
};

// A sequence of images with time stamps, read one after the other.
class DYNAMIC_SLAM_API FrameSource {
 public:
  virtual ~FrameSource() = default;

  // The next readable image, or nothing at the end. An image that is missing, cannot be decoded or has the
  // wrong size, a stamp that goes back and a duplicate are skipped and kept in Problems(); only hopeless
  // sources throw.
  virtual std::optional<SourceImage> Next() = 0;

  // Frames in all that Next() will try, after start and max_frames, with those it will skip; 0 when unknown.
  virtual size_t FrameCount() const = 0;

  // "tum", "kitti", "euroc", "images", "video", "live".
  virtual std::string Layout() const = 0;

  // Whether images come by themselves at their time, and are gone when nobody takes them.
  virtual bool IsLive() const { return false; }

  // Why Next() said that this is the end, where it should not be: a stream that stayed away. Else "".
  virtual std::string EndReason() const { return ""; }

  // The camera that the source itself describes (camera.yaml, else KITTI's calib.txt or EuRoC's sensor.yaml),
  // if any. Throws InputError when that file is wrong.
  virtual std::optional<Camera> OwnCamera() const = 0;

  // Size of the first image, px.
  virtual cv::Size ImageSize() const = 0;

  // What was skipped so far, in order.
  virtual const std::vector<SourceProblem>& Problems() const = 0;
};

struct FrameSourceOptions {
  double fps = 0;         // of a folder of images (0: 30) and of a video (0: what the file says)
  int start = 0;          // frames skipped at the beginning, without decoding them
  int max_frames = 0;     // frames tried after that; 0: all
  bool any_size = false;  // images of another size than the first are not skipped

  // Of a camera or a stream: what the user should hear at once, such as that it is gone and looked for again,
  // and whether to give that up.
  std::function<void(const std::string&)> on_event{};
  std::function<bool()> should_stop{};
};

// Opens a folder in TUM RGB-D (rgb.txt), KITTI odometry (image_0, times.txt) or EuRoC layout (mav0, or the
// folder above it, or cam0), a folder of images (in natural order), a video file, a camera ("camera:0") or a
// stream ("rtsp://..."). Throws InputError with the reason and the remedy when there is no such thing, its
// layout is not known or no image of it can be read.
DYNAMIC_SLAM_API std::unique_ptr<FrameSource> OpenFrameSource(const std::filesystem::path& path,
                                                              const FrameSourceOptions& options = {});

}  // namespace dynamic_slam
