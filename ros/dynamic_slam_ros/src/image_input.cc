#include "image_input.h"

#include <utility>

#include "conversions.h"

namespace dynamic_slam {

ImageInput::ImageInput(ros::NodeHandle* node, const std::string& topic, bool compressed, uint32_t waiting,
                       Callback callback)
    : callback_(std::move(callback)) {
  if (compressed) {
    subscriber_ = node->subscribe(node->resolveName(topic) + "/compressed", waiting,
                                  &ImageInput::Take<sensor_msgs::CompressedImage>, this);
  } else {
    subscriber_ = node->subscribe(topic, waiting, &ImageInput::Take<sensor_msgs::Image>, this);
  }
}

template <class Message>
void ImageInput::Take(const boost::shared_ptr<const Message>& message) {
  std::string reason;
  const cv::Mat image = ImageFromMessage(*message, &reason);
  callback_(message->header, image, reason);
}

}  // namespace dynamic_slam
