#include "bag_source.h"

#include <algorithm>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include "conversions.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/checked_source.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

constexpr char kImage[] = "sensor_msgs/Image", kCompressed[] = "sensor_msgs/CompressedImage",
               kCameraInfo[] = "sensor_msgs/CameraInfo";

class BagSource : public CheckedSource {
 public:
  BagSource(const fs::path& file, const std::string& image_topic, const std::string& camera_topic)
      : CheckedSource("bag", /*any_size=*/false), file_(file.string()) {
    std::error_code ignored;
    if (!fs::is_regular_file(file, ignored))
      throw InputError(file_, "there is no such file", "Check the path.");
    try {
      bag_.open(file_, rosbag::bagmode::Read);
      ReadCamera(Choose({kCameraInfo}, camera_topic, /*is_optional=*/camera_topic.empty()));
      const std::string topic = Choose({kImage, kCompressed}, image_topic, false);
      images_.addQuery(bag_, rosbag::TopicQuery(topic));
    } catch (const rosbag::BagException& error) {
      throw InputError(file_, fmt::format("is no bag that can be read: {}", error.what()),
                       "If it was not closed, `rosbag reindex` may mend it.");
    }
    next_ = images_.begin();
    count_ = images_.size();
    ReadFirst(file);
  }

  size_t FrameCount() const override { return count_; }
  std::optional<Camera> OwnCamera() const override {
    return camera_ != nullptr ? std::optional(CameraFromMessage(*camera_)) : std::nullopt;
  }

 protected:
  bool ReadNext(SourceImage* image, std::string* reason) override {
    if (next_ == images_.end()) return false;
    image->name = fmt::format("message {}", index_++);
    try {
      const rosbag::MessageInstance& message = *next_;
      if (const auto raw = message.instantiate<sensor_msgs::Image>()) {
        image->timestamp_s = StampSeconds(raw->header.stamp);
        image->image = ImageFromMessage(*raw, reason);
      } else if (const auto file = message.instantiate<sensor_msgs::CompressedImage>()) {
        image->timestamp_s = StampSeconds(file->header.stamp);
        image->image = ImageFromMessage(*file, reason);
      } else {
        *reason = fmt::format("it is a {}", message.getDataType());
      }
    } catch (const std::exception& error) {  // of rosbag, of roscpp's serialisation
      *reason = fmt::format("the message is damaged: {}", error.what());
    }
    ++next_;
    return true;
  }

 private:
  // The topic of one of the types. Throws InputError when there is none, or several and none is named.
  std::string Choose(const std::vector<std::string>& types, const std::string& wanted, bool is_optional) {
    std::vector<std::string> topics;
    rosbag::View all(bag_, rosbag::TypeQuery(types));
    for (const rosbag::ConnectionInfo* connection : all.getConnections()) {
      if (std::find(topics.begin(), topics.end(), connection->topic) == topics.end()) {
        topics.push_back(connection->topic);
      }
    }
    std::sort(topics.begin(), topics.end());
    if (!wanted.empty()) {
      if (std::find(topics.begin(), topics.end(), wanted) != topics.end()) return wanted;
    } else if (topics.size() == 1 || (is_optional && topics.empty())) {
      return topics.empty() ? "" : topics.front();
    }
    const std::string has = topics.empty() ? "none" : fmt::format("{}", fmt::join(topics, ", "));
    throw InputError(file_,
                     wanted.empty() ? fmt::format("it is not clear which topic of {} is meant", types.front())
                                    : fmt::format("has no topic {} of {}", wanted, types.front()),
                     fmt::format("It has: {}. Name one with --topic or --camera-topic.", has));
  }

  void ReadCamera(const std::string& topic) {
    if (topic.empty()) return;
    rosbag::View view(bag_, rosbag::TopicQuery(topic));
    camera_ = view.begin()->instantiate<sensor_msgs::CameraInfo>();
  }

  std::string file_;
  rosbag::Bag bag_;
  rosbag::View images_;
  rosbag::View::iterator next_;
  size_t index_ = 0, count_ = 0;
  boost::shared_ptr<sensor_msgs::CameraInfo> camera_;  // null: there is none
};

}  // namespace

std::unique_ptr<FrameSource> OpenBag(const fs::path& file, const std::string& image_topic,
                                     const std::string& camera_topic) {
  return std::make_unique<BagSource>(file, image_topic, camera_topic);
}

}  // namespace dynamic_slam
