#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/io/frame_source.h"

namespace dynamic_slam {

// "camera:0", the number of a video device, or a stream: "rtsp://...", "http://...".
bool IsLiveSource(const std::string& name);

// The name as it may be shown and kept: "rtsp://user:***@host/stream".
std::string WithoutPassword(std::string name);

// A folder below `parent` with the name of the source that is not there yet, or empty: what a camera saw
// cannot be seen again, so that a later run must not write over it.
std::filesystem::path LiveFolder(const std::filesystem::path& parent, const std::string& name);

// Something that gives images for as long as it is there.
class ImageGrabber {
 public:
  virtual ~ImageGrabber() = default;
  virtual bool Open() = 0;                // anew, when it was open
  virtual bool Grab(cv::Mat* image) = 0;  // waits for the next image; false: it is gone
};

// Time, for tests: seconds, and to wait for some.
struct LiveClock {
  std::function<double()> now_s;
  std::function<void(double)> wait_s;
};

// Images with the time at which they came, s since the first. A grabber that is gone is opened again, once a
// second, until there are images or a minute is over; then the source ends, with a reason. Throws InputError
// when it cannot be opened at first.
std::unique_ptr<FrameSource> MakeLiveSource(const std::string& name, std::unique_ptr<ImageGrabber> grabber,
                                            const FrameSourceOptions& options, LiveClock clock);

// By OpenCV: V4L2 for cameras, FFmpeg for streams. Null for the address of a film: it has an end, and its
// images come when they are asked for.
std::unique_ptr<FrameSource> OpenLiveSource(const std::string& name, const FrameSourceOptions& options);

}  // namespace dynamic_slam
