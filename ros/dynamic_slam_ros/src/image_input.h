#pragma once

#include <functional>
#include <string>

#include <opencv2/core/mat.hpp>
#include <ros/node_handle.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

namespace dynamic_slam {

// Images from a topic, as sensor_msgs/Image, or as CompressedImage from TOPIC/compressed, where
// image_transport puts them.
class ImageInput {
 public:
  // The image is as in SourceImage, or empty, and `reason` says why.
  using Callback =
      std::function<void(const std_msgs::Header& header, const cv::Mat& image, const std::string& reason)>;

  // waiting: images that wait while the callback runs; of more the oldest is dropped.
  ImageInput(ros::NodeHandle* node, const std::string& topic, bool compressed, uint32_t waiting,
             Callback callback);

  std::string topic() const { return subscriber_.getTopic(); }

 private:
  template <class Message>
  void Take(const boost::shared_ptr<const Message>& message);

  Callback callback_;
  ros::Subscriber subscriber_;
};

}  // namespace dynamic_slam
