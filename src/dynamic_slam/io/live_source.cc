#include "dynamic_slam/io/live_source.h"

#include <cctype>
#include <charconv>
#include <chrono>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>
#include <time.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/trace.h"
#include "dynamic_slam/io/checked_source.h"

namespace dynamic_slam {
namespace {

constexpr std::string_view kCameraPrefix = "camera:";
constexpr double kRetryS = 1;      // between two attempts to open it again
constexpr double kPatienceS = 60;  // until it is given up

class LiveSource : public CheckedSource {
 public:
  LiveSource(const std::string& name, std::unique_ptr<ImageGrabber> grabber,
             const FrameSourceOptions& options, LiveClock clock)
      : CheckedSource("live", options.any_size),
        name_(name),
        grabber_(std::move(grabber)),
        options_(options),
        clock_(std::move(clock)) {
    if (!grabber_->Open()) {
      throw InputError(name, "cannot be opened",
                       name.starts_with(kCameraPrefix)
                           ? "Is it plugged in, free and readable for you? /dev/video0 is camera:0."
                           : "Check the address, the password and the network.");
    }
    ReadFirst(name);
  }

  size_t FrameCount() const override { return 0; }
  bool IsLive() const override { return true; }
  std::string EndReason() const override { return end_reason_; }
  std::optional<Camera> OwnCamera() const override { return std::nullopt; }

 protected:
  bool ReadNext(SourceImage* image, std::string*) override {
    DS_TRACE("io/grab");
    if (options_.max_frames > 0 && count_ >= options_.max_frames) return false;
    do {
      cv::Mat grabbed;
      while (!grabber_->Grab(&grabbed) || grabbed.empty()) {
        if (!Reconnect()) return false;
      }
      const double now_s = clock_.now_s();
      if (lost_s_.has_value()) Tell(fmt::format("found again after {:.1f} s", now_s - *lost_s_));
      lost_s_.reset();
      if (!first_s_.has_value()) first_s_ = now_s;
      *image = {now_s - *first_s_, grabbed.clone(), fmt::format("image {}", index_++)};
    } while (index_ <= options_.start);
    ++count_;
    return true;
  }

 private:
  void Tell(const std::string& event) const {
    if (options_.on_event) options_.on_event(name_ + ": " + event);
  }

  // Opens it again. False: it stays away, or nobody wants it any more. One that can be opened, but gives no
  // image, is still away.
  bool Reconnect() {
    if (!first_s_.has_value()) return false;  // there never was an image
    bool waits = lost_s_.has_value();         // not before the first attempt
    if (!waits) {
      lost_s_ = clock_.now_s();
      Tell(fmt::format("no more images; it is looked for again, for {:.0f} s", kPatienceS));
    }
    while (!(options_.should_stop && options_.should_stop())) {
      if (clock_.now_s() - *lost_s_ >= kPatienceS) {
        end_reason_ = fmt::format("gave no image for {:.0f} s", kPatienceS);
        Tell("given up");
        return false;
      }
      if (waits) clock_.wait_s(kRetryS);
      if (grabber_->Open()) return true;
      waits = true;
    }
    return false;
  }

  std::string name_;
  std::unique_ptr<ImageGrabber> grabber_;
  FrameSourceOptions options_;
  LiveClock clock_;
  int index_ = 0, count_ = 0;
  std::optional<double> first_s_, lost_s_;
  std::string end_reason_;
};

class OpenCvGrabber : public ImageGrabber {
 public:
  explicit OpenCvGrabber(std::string name) : name_(std::move(name)) {}

  bool Open() override {
    // Each of OpenCV's backends logs why it cannot; our message says it once.
    const auto level = cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    const bool is_open = name_.starts_with(kCameraPrefix) ? OpenCamera() : OpenStream();
    cv::utils::logging::setLogLevel(level);
    return is_open;
  }

  bool Grab(cv::Mat* image) override { return capture_.read(*image); }

  // Of a stream FFmpeg does not know how long it is.
  bool IsFilm() const {
    return !name_.starts_with(kCameraPrefix) && capture_.get(cv::CAP_PROP_FRAME_COUNT) > 0;
  }

 private:
  bool OpenCamera() {
    int number = 0;
    const std::string digits = name_.substr(kCameraPrefix.size());
    const char* const end = digits.data() + digits.size();
    const auto [rest, error] = std::from_chars(digits.data(), end, number);
    if (error != std::errc() || rest != end || number < 0) return false;
    // Old images must not wait for us.
    return capture_.open(number, cv::CAP_V4L2) && (capture_.set(cv::CAP_PROP_BUFFERSIZE, 1), true);
  }

  bool OpenStream() {
    constexpr int kTimeoutMs = 10000;
    return capture_.open(
        name_, cv::CAP_FFMPEG,
        {cv::CAP_PROP_OPEN_TIMEOUT_MSEC, kTimeoutMs, cv::CAP_PROP_READ_TIMEOUT_MSEC, kTimeoutMs});
  }

  std::string name_;
  cv::VideoCapture capture_;
};

void Sleep(double s) {
  timespec time{static_cast<time_t>(s), 0};
  time.tv_nsec = static_cast<long>(1e9 * (s - static_cast<double>(time.tv_sec)));
  nanosleep(&time, nullptr);  // a signal ends it early, as it should
}

}  // namespace

bool IsLiveSource(const std::string& name) {
  return name.starts_with(kCameraPrefix) || name.find("://") != std::string::npos;
}

std::string WithoutPassword(std::string name) {
  const size_t scheme = name.find("://");
  if (scheme == std::string::npos) return name;
  const size_t user = scheme + 3, at = name.substr(0, name.find('/', user)).rfind('@');
  if (at == std::string::npos) return name;
  const size_t colon = name.find(':', user);
  return colon < at ? name.replace(colon + 1, at - colon - 1, "***") : name;
}

std::filesystem::path LiveFolder(const std::filesystem::path& parent, const std::string& name) {
  // Who asks and how is nobody's business: the host and the path only.
  std::string stem = name;
  if (const size_t scheme = name.find("://"); scheme != std::string::npos) {
    stem = name.substr(scheme + 3, name.find_first_of("?#") - (scheme + 3));
    stem.erase(0, stem.substr(0, stem.find('/')).rfind('@') + 1);
  }
  while (stem.ends_with('/')) stem.pop_back();
  for (char& letter : stem) {
    if (!std::isalnum(static_cast<unsigned char>(letter)) && letter != '.' && letter != '-') letter = '_';
  }
  stem.erase(0, stem.find_first_not_of("._"));
  if (stem.empty()) stem = "live";
  std::filesystem::path folder = parent / stem;
  std::error_code ignored;
  for (int i = 2; std::filesystem::exists(folder, ignored) && !std::filesystem::is_empty(folder, ignored);
       ++i) {
    folder = parent / fmt::format("{}_{}", stem, i);
  }
  return folder;
}

std::unique_ptr<FrameSource> MakeLiveSource(const std::string& name, std::unique_ptr<ImageGrabber> grabber,
                                            const FrameSourceOptions& options, LiveClock clock) {
  return std::make_unique<LiveSource>(WithoutPassword(name), std::move(grabber), options, std::move(clock));
}

std::unique_ptr<FrameSource> OpenLiveSource(const std::string& name, const FrameSourceOptions& options) {
  const LiveClock clock{[] {
                          const auto now = std::chrono::steady_clock::now().time_since_epoch();
                          return std::chrono::duration<double>(now).count();
                        },
                        Sleep};
  auto grabber = std::make_unique<OpenCvGrabber>(name);
  const OpenCvGrabber& opened = *grabber;
  std::unique_ptr<FrameSource> source = MakeLiveSource(name, std::move(grabber), options, clock);
  return opened.IsFilm() ? nullptr : std::move(source);
}

}  // namespace dynamic_slam
