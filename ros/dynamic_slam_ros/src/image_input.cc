#include "image_input.h"

#include <utility>

#include "conversions.h"

namespace dynamic_slam {

class ImageInput::Delivery : public ros::CallbackInterface {
 public:
  explicit Delivery(ImageInput* input) : input_(input) {}
  CallResult call() override {
    input_->Deliver();
    return Success;
  }

 private:
  ImageInput* input_;
};

ImageInput::ImageInput(const std::string& topic, bool compressed, uint32_t waiting, Callback callback)
    : callback_(std::move(callback)), capacity_(waiting) {
  ros::NodeHandle node;
  node.setCallbackQueue(&queue_);
  if (compressed) {
    subscriber_ = node.subscribe(node.resolveName(topic) + "/compressed", waiting,
                                 &ImageInput::Take<sensor_msgs::CompressedImage>, this);
  } else {
    subscriber_ = node.subscribe(topic, waiting, &ImageInput::Take<sensor_msgs::Image>, this);
  }
  decoder_.start();
}

ImageInput::~ImageInput() {
  decoder_.stop();
  ros::getGlobalCallbackQueue()->removeByID(reinterpret_cast<uint64_t>(this));
}

template <class Message>
void ImageInput::Take(const boost::shared_ptr<const Message>& message) {
  Decoded decoded;
  decoded.header = message->header;
  decoded.image = ImageFromMessage(*message, &decoded.reason);
  {
    MutexLock lock(mutex_);
    if (waiting_.size() == capacity_) waiting_.pop_front();
    waiting_.push_back(std::move(decoded));
  }
  ros::getGlobalCallbackQueue()->addCallback(boost::make_shared<Delivery>(this),
                                             reinterpret_cast<uint64_t>(this));
}

void ImageInput::Deliver() {
  Decoded decoded;
  {
    MutexLock lock(mutex_);
    if (waiting_.empty()) return;  // dropped since
    decoded = std::move(waiting_.front());
    waiting_.pop_front();
  }
  callback_(decoded.header, decoded.image, decoded.reason);
}

}  // namespace dynamic_slam
