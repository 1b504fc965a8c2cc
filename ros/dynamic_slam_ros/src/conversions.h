#pragma once

#include <string>

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/Transform.h>
#include <opencv2/core/mat.hpp>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/rigid3.h"

namespace dynamic_slam {

// The number that the decimal text of the stamp reads as: what other readers make of a stamp in a file.
double StampSeconds(const ros::Time& stamp);

// The stamp that the shortest decimal text of the number names.
ros::Time StampFromSeconds(double seconds);

// As SourceImage has it. mono8, mono16, 8UC1, 16UC1, bgr8, rgb8, bgra8, rgba8, 8UC3 and the Bayer patterns of
// 8 and 16 bits, which become BGR. Empty, and *reason says why, for another encoding and for a message whose
// sizes do not fit each other.
cv::Mat ImageFromMessage(const sensor_msgs::Image& message, std::string* reason);

// The same of an image file in a message: JPEG, PNG.
cv::Mat ImageFromMessage(const sensor_msgs::CompressedImage& message, std::string* reason);

// CV_8UC1 as mono8, CV_8UC3 as bgr8.
sensor_msgs::Image MessageFromImage(const cv::Mat& image, const std_msgs::Header& header);

// JPEG.
sensor_msgs::CompressedImage CompressedFromImage(const cv::Mat& image, const std_msgs::Header& header);

// plumb_bob, equidistant, or rational_polynomial without its denominator. Throws InputError when there is no
// calibration in it, or one that is not supported: another lens, a region of interest, binning.
Camera CameraFromMessage(const sensor_msgs::CameraInfo& message);
sensor_msgs::CameraInfo MessageFromCamera(const Camera& camera);

geometry_msgs::Pose PoseMessage(const Rigid3& target_from_source);
geometry_msgs::Transform TransformMessage(const Rigid3& target_from_source);
Rigid3 RigidFromMessage(const geometry_msgs::Transform& transform);

}  // namespace dynamic_slam
