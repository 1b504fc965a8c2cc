#include "dynamic_slam/system/frame_feed.h"

#include <algorithm>
#include <atomic>
#include <chrono>

#include "dynamic_slam/base/bounded_queue.h"
#include "dynamic_slam/base/mutex.h"
#include "dynamic_slam/base/worker.h"

namespace dynamic_slam {
namespace {

using Clock = std::chrono::steady_clock;

// Half a second at 30 frames a second, which a start may take; tracking is several times faster than a camera
// and soon catches up. A start that misses frames is slower, and sometimes wrong.
constexpr size_t kWaitingImages = 15;

// A recording may have a gap of hours; nobody waits for that.
constexpr double kLongestPauseS = 1.0;

// So long after an image no other one is read, if that leaves time to read it: a camera would not take the
// processor from tracking, which has just got the image. Several times what tracking takes.
constexpr Clock::duration kLongestRest = std::chrono::milliseconds(20);

class DirectFeed : public FrameFeed {
 public:
  explicit DirectFeed(FrameSource* source) : source_(source) {}
  std::optional<SourceImage> Next() override { return source_->Next(); }
  size_t DroppedCount() const override { return 0; }

 private:
  FrameSource* source_;
};

class RealtimeFeed : public FrameFeed {
 public:
  explicit RealtimeFeed(FrameSource* source) : source_(source), images_(kWaitingImages), camera_("camera") {
    camera_.Post([this](const std::stop_token& token) {
      // However it ends, whoever waits for an image must hear of it.
      const auto close = [](BoundedQueue<SourceImage>* images) { images->Close(); };
      const std::unique_ptr<BoundedQueue<SourceImage>, decltype(close)> at_the_end(&images_, close);
      Run(token);
    });
  }

  std::optional<SourceImage> Next() override {
    std::optional<SourceImage> image = images_.Pop();
    if (!image.has_value()) camera_.Drain();  // throws what the source threw
    return image;
  }

  size_t DroppedCount() const override { return dropped_; }

 private:
  void Run(const std::stop_token& token) {
    std::optional<double> last_stamp_s;
    Clock::time_point due = Clock::now();
    Clock::duration pause{}, reading{};  // before the last image, and of it
    while (!token.stop_requested()) {
      if (!source_->IsLive() && reading < pause / 4)
        WaitUntil(due + std::min(pause / 2, kLongestRest), token);
      const Clock::time_point start = Clock::now();
      std::optional<SourceImage> image = source_->Next();
      if (!image.has_value()) return;
      reading = Clock::now() - start;
      if (last_stamp_s.has_value()) {
        const double pause_s = std::clamp(image->timestamp_s - *last_stamp_s, 0.0, kLongestPauseS);
        pause = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(pause_s));
        due += pause;
      }
      last_stamp_s = image->timestamp_s;
      if (!source_->IsLive()) WaitUntil(due, token);
      dropped_ += images_.Push(std::move(*image)).has_value();
    }
  }

  void WaitUntil(Clock::time_point due, const std::stop_token& token) {
    const std::stop_callback wake(token, [this] {
      MutexLock lock(mutex_);
      woken_.NotifyAll();
    });
    MutexLock lock(mutex_);
    while (!token.stop_requested() && woken_.WaitUntil(mutex_, due)) {
    }
  }

  FrameSource* source_;
  BoundedQueue<SourceImage> images_;
  std::atomic<size_t> dropped_ = 0;
  Mutex mutex_;
  CondVar woken_;
  Worker camera_;  // last: it uses all the others
};

}  // namespace

std::unique_ptr<FrameFeed> MakeDirectFeed(FrameSource* source) {
  return std::make_unique<DirectFeed>(source);
}

std::unique_ptr<FrameFeed> MakeRealtimeFeed(FrameSource* source) {
  return std::make_unique<RealtimeFeed>(source);
}

}  // namespace dynamic_slam
