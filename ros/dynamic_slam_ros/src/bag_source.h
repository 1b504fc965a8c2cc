#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "dynamic_slam/io/frame_source.h"

namespace dynamic_slam {

// The images of one topic of a bag, sensor_msgs/Image or CompressedImage, with the stamps of their headers.
// image_topic: empty for the only one. The first message of camera_topic, empty for any of
// sensor_msgs/CameraInfo, is the source's own camera. Throws InputError when the bag cannot be read, or it is
// not clear which topic is meant.
std::unique_ptr<FrameSource> OpenBag(const std::filesystem::path& file, const std::string& image_topic = "",
                                     const std::string& camera_topic = "");

}  // namespace dynamic_slam
