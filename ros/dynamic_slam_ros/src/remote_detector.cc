#include "remote_detector.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <stdexcept>

#include <dynamic_slam_ros/Detections.h>
#include <fmt/core.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include "conversions.h"

namespace dynamic_slam {
namespace {

using Clock = std::chrono::steady_clock;
using dynamic_slam_ros::Detections;

// Stamps of now are doubles to 0.24 us.
constexpr double kSameStampS = 1e-5;

std::vector<std::string> WithOther(std::vector<std::string> class_names) {
  class_names.emplace_back("other");
  return class_names;
}

class RemoteDetector : public Detector {
 public:
  RemoteDetector(const RemoteDetectorOptions& options, std::vector<std::string> class_names)
      : Detector("ros", WithOther(std::move(class_names))), options_(options) {
    node_.setCallbackQueue(&queue_);
    if (options_.compressed) {
      images_ = node_.advertise<sensor_msgs::CompressedImage>("detector/image/compressed", 1);
    } else {
      images_ = node_.advertise<sensor_msgs::Image>("detector/image", 1);
    }
    answers_ = node_.subscribe("detector/detections", 10, &RemoteDetector::Take, this);
  }

 private:
  // Runs on the thread that asks, and so do the callbacks: nobody else calls the queue.
  std::vector<Detection> Find(const cv::Mat& image, FrameId, double timestamp_s) override {
    const Clock::time_point deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                                          std::chrono::duration<double>(options_.timeout_s));
    // While nobody listens, or before the first answer, the node may be on its way.
    while (answers_.getNumPublishers() == 0) {
      if (!WaitUntil(deadline)) {
        throw std::runtime_error(fmt::format("no detector is connected to {}", answers_.getTopic()));
      }
    }
    std_msgs::Header header;
    header.stamp = StampFromSeconds(timestamp_s);
    if (options_.compressed) {
      images_.publish(CompressedFromImage(image, header));
    } else {
      images_.publish(MessageFromImage(image, header));
    }
    while (true) {
      for (const Detections::ConstPtr& answer : waiting_) {
        const double later_s = StampSeconds(answer->header.stamp) - timestamp_s;
        if (std::abs(later_s) < kSameStampS) return FromMessage(*answer);
        if (later_s > 0) throw std::runtime_error("the detector's answer was lost, or it left the image out");
      }
      waiting_.clear();
      if (!WaitUntil(deadline)) {
        throw std::runtime_error(
            fmt::format("no answer of the detector within {:.3g} s", options_.timeout_s));
      }
    }
  }

  // Takes what comes; false when the time is up.
  bool WaitUntil(Clock::time_point deadline) {
    const double left_s = std::chrono::duration<double>(deadline - Clock::now()).count();
    if (left_s <= 0 || !ros::ok()) return false;
    queue_.callAvailable(ros::WallDuration(std::min(left_s, 0.05)));
    return true;
  }

  void Take(const Detections::ConstPtr& answer) { waiting_.push_back(answer); }

  std::vector<Detection> FromMessage(const Detections& message) const {
    if (!message.failure.empty()) throw std::runtime_error("the detector failed: " + message.failure);
    std::vector<Detection> detections;
    for (const dynamic_slam_ros::Detection& d : message.detections) {
      const auto found = std::find(class_names().begin(), class_names().end() - 1, d.class_name);
      detections.push_back(
          {{d.x, d.y, d.width, d.height}, static_cast<int>(found - class_names().begin()), d.score});
    }
    return detections;
  }

  RemoteDetectorOptions options_;
  ros::CallbackQueue queue_;
  ros::NodeHandle node_;
  ros::Publisher images_;
  ros::Subscriber answers_;
  std::deque<Detections::ConstPtr> waiting_;
};

}  // namespace

std::unique_ptr<Detector> MakeRemoteDetector(const RemoteDetectorOptions& options,
                                             std::vector<std::string> class_names) {
  return std::make_unique<RemoteDetector>(options, std::move(class_names));
}

}  // namespace dynamic_slam
