#include "dynamic_slam/io/frame_source.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/camera_import.h"
#include "dynamic_slam/io/checked_source.h"
#include "dynamic_slam/io/image_file.h"
#include "dynamic_slam/io/live_source.h"
#include "dynamic_slam/io/source_layout.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

constexpr double kDefaultFps = 30;

// A folder with a list of image files.
class ListedSource : public CheckedSource {
 public:
  ListedSource(const fs::path& path, SourceListing listing, const FrameSourceOptions& options)
      : CheckedSource(listing.layout, options.any_size),
        listing_(std::move(listing)),
        all_(listing_.entries) {
    const size_t start = static_cast<size_t>(options.start);
    if (start >= all_.size()) {
      throw InputError(path.string(),
                       fmt::format("--start {} skips all of its {} frames", start, all_.size()),
                       "Start earlier.");
    }
    next_ = start;
    const size_t wanted = static_cast<size_t>(options.max_frames);
    end_ = wanted == 0 ? all_.size() : std::min(all_.size(), start + wanted);
    count_ = end_ - next_;
    ReadFirst(path);
  }

  size_t FrameCount() const override { return count_; }

  std::optional<Camera> OwnCamera() const override {
    if (fs::is_regular_file(listing_.folder / "camera.yaml"))
      return ReadCamera(listing_.folder / "camera.yaml");
    if (!fs::is_regular_file(listing_.calib)) return std::nullopt;
    if (Layout() == "euroc") return ImportCamera(listing_.calib);
    return WithKnownLens(ReadKittiCalibration(listing_.calib, ImageSize(), MeanFps()), "kitti");
  }

 protected:
  bool ReadNext(SourceImage* image, std::string* reason) override {
    if (next_ == end_) return false;
    const SourceEntry& entry = all_[next_++];
    *reason = entry.problem;
    *image = {entry.timestamp_s, {}, entry.name};
    if (reason->empty()) image->image = ReadImage(entry.file, reason);
    return true;
  }

 private:
  double MeanFps() const {
    const SourceEntry *first = nullptr, *last = nullptr;
    size_t count = 0;
    for (const SourceEntry& entry : all_) {
      if (!entry.problem.empty()) continue;
      if (first == nullptr) first = &entry;
      last = &entry;
      ++count;
    }
    if (count < 2 || !(last->timestamp_s > first->timestamp_s)) return 0;
    return static_cast<double>(count - 1) / (last->timestamp_s - first->timestamp_s);
  }

  SourceListing listing_;
  const std::vector<SourceEntry>& all_;
  size_t next_ = 0, end_ = 0, count_ = 0;
};

class VideoSource : public CheckedSource {
 public:
  VideoSource(const fs::path& path, const FrameSourceOptions& options)
      : CheckedSource("video", options.any_size) {
    if (!OpenQuietly(path.string())) {
      throw InputError(
          WithoutPassword(path.string()), "is not a video that can be read",
          "Give the folder of a sequence; or convert the video, for instance with ffmpeg to MP4.");
    }
    fps_ = options.fps > 0 ? options.fps : capture_.get(cv::CAP_PROP_FPS);
    if (!(fps_ > 0 && fps_ < 1e5)) fps_ = kDefaultFps;
    const double announced = capture_.get(cv::CAP_PROP_FRAME_COUNT);
    total_ = announced > 0 && announced < 1e9 ? static_cast<size_t>(announced) : 0;
    start_ = static_cast<size_t>(options.start);
    // Seeking by number is inexact in many formats; grabbing is exact and converts nothing.
    while (index_ < start_ && capture_.grab()) ++index_;
    if (options.max_frames > 0) end_ = start_ + static_cast<size_t>(options.max_frames);
    ReadFirst(WithoutPassword(path.string()));
  }

  size_t FrameCount() const override {
    if (total_ == 0) return 0;
    const size_t end = end_ == 0 ? total_ : std::min(end_, total_);
    return end > start_ ? end - start_ : 0;
  }

  std::optional<Camera> OwnCamera() const override { return std::nullopt; }

 protected:
  bool ReadNext(SourceImage* image, std::string* reason) override {
    if (ended_ || (end_ != 0 && index_ >= end_)) return false;
    image->timestamp_s = static_cast<double>(index_) / fps_;
    image->name = fmt::format("frame {}", index_);
    DS_TRACE("io/decode");
    cv::Mat frame;
    if (!capture_.read(frame) || frame.empty()) {
      ended_ = true;
      if (total_ == 0 || index_ >= total_) return false;
      *reason = fmt::format("the video ends here, though {} frames are announced", total_);
      return true;
    }
    ++index_;
    image->image = frame.clone();  // the decoder may use its buffer again
    return true;
  }

 private:
  // Each of OpenCV's backends logs why it cannot read a file; our error says it once.
  bool OpenQuietly(const std::string& file) {
    const auto level = cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    const bool opened = capture_.open(file);
    cv::utils::logging::setLogLevel(level);
    return opened;
  }

  cv::VideoCapture capture_;
  double fps_ = kDefaultFps;
  size_t total_ = 0, start_ = 0, end_ = 0, index_ = 0;
  bool ended_ = false;
};

}  // namespace

std::unique_ptr<FrameSource> OpenFrameSource(const fs::path& path, const FrameSourceOptions& options) {
  if (options.start < 0 || options.max_frames < 0 || !(options.fps >= 0 && options.fps < 1e5)) {
    throw InputError("options of the source",
                     fmt::format("fps {}, start {}, max_frames {}: none may be negative", options.fps,
                                 options.start, options.max_frames),
                     "Leave out what is not needed.");
  }
  if (IsLiveSource(path.string())) {
    if (auto live = OpenLiveSource(path.string(), options)) return live;
    return std::make_unique<VideoSource>(path, options);
  }
  std::error_code ignored;
  if (!fs::exists(path, ignored)) {
    throw InputError(path.string(), "there is no such file or folder", "Check the path.");
  }
  if (fs::is_regular_file(path, ignored) && HasImageExtension(path)) {
    throw InputError(path.string(), "is a single image", "Give the folder of the images, or a video file.");
  }
  if (!fs::is_directory(path, ignored)) return std::make_unique<VideoSource>(path, options);
  const double fps = options.fps > 0 ? options.fps : kDefaultFps;
  return std::make_unique<ListedSource>(path, ListSource(path, fps), options);
}

}  // namespace dynamic_slam
