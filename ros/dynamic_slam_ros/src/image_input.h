#pragma once

#include <deque>
#include <functional>
#include <string>

#include <opencv2/core/mat.hpp>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include "dynamic_slam/base/mutex.h"

namespace dynamic_slam {

// Images from a topic, as sensor_msgs/Image, or as CompressedImage from TOPIC/compressed, where
// image_transport puts them. They are decoded in a thread of their own, while those before them are worked
// on.
class ImageInput {
 public:
  // The image is as in SourceImage, or empty, and `reason` says why.
  using Callback =
      std::function<void(const std_msgs::Header& header, const cv::Mat& image, const std::string& reason)>;

  // The callback is called where ros::spin is. waiting: images that wait while it runs; of more the oldest is
  // dropped.
  ImageInput(const std::string& topic, bool compressed, uint32_t waiting, Callback callback);
  ~ImageInput();
  ImageInput(const ImageInput&) = delete;
  ImageInput& operator=(const ImageInput&) = delete;

  std::string topic() const { return subscriber_.getTopic(); }

 private:
  struct Decoded {
    std_msgs::Header header;
    cv::Mat image;
    std::string reason;
  };
  class Delivery;

  template <class Message>
  void Take(const boost::shared_ptr<const Message>& message);
  void Deliver();  // one, if there is one

  const Callback callback_;
  const size_t capacity_;
  Mutex mutex_;
  std::deque<Decoded> waiting_ DS_GUARDED_BY(mutex_);
  ros::CallbackQueue queue_;  // of messages as they come
  ros::Subscriber subscriber_;
  ros::AsyncSpinner decoder_{1, &queue_};  // last: it uses all the others
};

}  // namespace dynamic_slam
