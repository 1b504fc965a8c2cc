#include "conversions.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include <boost/endian/conversion.hpp>
#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"
#include "dynamic_slam/io/image_file.h"

namespace dynamic_slam {
namespace {

struct Encoding {
  int type;             // of OpenCV
  int conversion = -1;  // to BGR or BGRA, of OpenCV; -1: none is needed
};

// OpenCV names Bayer patterns after the second row's second and third pixel, ROS after the top left ones.
const std::map<std::string, Encoding>& Encodings() {
  static const std::map<std::string, Encoding> encodings = {
      {"mono8", {CV_8UC1}},
      {"8UC1", {CV_8UC1}},
      {"mono16", {CV_16UC1}},
      {"16UC1", {CV_16UC1}},
      {"bgr8", {CV_8UC3}},
      {"8UC3", {CV_8UC3}},
      {"bgra8", {CV_8UC4}},
      {"rgb8", {CV_8UC3, cv::COLOR_RGB2BGR}},
      {"rgba8", {CV_8UC4, cv::COLOR_RGBA2BGRA}},
      {"bayer_rggb8", {CV_8UC1, cv::COLOR_BayerBG2BGR}},
      {"bayer_bggr8", {CV_8UC1, cv::COLOR_BayerRG2BGR}},
      {"bayer_gbrg8", {CV_8UC1, cv::COLOR_BayerGR2BGR}},
      {"bayer_grbg8", {CV_8UC1, cv::COLOR_BayerGB2BGR}},
      {"bayer_rggb16", {CV_16UC1, cv::COLOR_BayerBG2BGR}},
      {"bayer_bggr16", {CV_16UC1, cv::COLOR_BayerRG2BGR}},
      {"bayer_gbrg16", {CV_16UC1, cv::COLOR_BayerGR2BGR}},
      {"bayer_grbg16", {CV_16UC1, cv::COLOR_BayerGB2BGR}},
  };
  return encodings;
}

}  // namespace

double StampSeconds(const ros::Time& stamp) {
  return ParseDouble(fmt::format("{}.{:09}", stamp.sec, stamp.nsec)).value();
}

ros::Time StampFromSeconds(double seconds) {
  // At today's stamps a double knows 0.24 us; the shortest text has no more digits than that.
  const std::string text = ShortestDouble(std::clamp(seconds, 0.0, 4294967295.0));
  const size_t point = text.find('.');
  if (point == std::string::npos || text.find('e') != std::string::npos) return ros::Time(seconds);
  const std::string fraction = (text.substr(point + 1) + "000000000").substr(0, 9);
  return {static_cast<uint32_t>(std::stoul(text.substr(0, point))),
          static_cast<uint32_t>(std::stoul(fraction))};
}

cv::Mat ImageFromMessage(const sensor_msgs::Image& message, std::string* reason) {
  const auto found = Encodings().find(message.encoding);
  if (found == Encodings().end()) {
    *reason = fmt::format("its encoding '{}' is not known", message.encoding);
    return {};
  }
  const Encoding& encoding = found->second;
  const uint64_t row_bytes = uint64_t{message.width} * static_cast<uint64_t>(CV_ELEM_SIZE(encoding.type));
  constexpr uint32_t kMaxPx = 100000;
  if (message.width == 0 || message.height == 0 || message.width > kMaxPx || message.height > kMaxPx ||
      message.step < row_bytes || message.data.size() < uint64_t{message.step} * message.height) {
    *reason = fmt::format("{} bytes are not {} x {} px of {} in rows of {} bytes", message.data.size(),
                          message.width, message.height, message.encoding, message.step);
    return {};
  }
  const cv::Mat view(static_cast<int>(message.height), static_cast<int>(message.width), encoding.type,
                     const_cast<uint8_t*>(message.data.data()), message.step);
  cv::Mat image;
  if (CV_MAT_DEPTH(encoding.type) == CV_16U && message.is_bigendian != 0) {
    image = view.clone();
    for (int y = 0; y < image.rows; ++y) {
      uint16_t* row = image.ptr<uint16_t>(y);
      std::transform(row, row + image.cols * image.channels(), row,
                     [](uint16_t value) { return boost::endian::endian_reverse(value); });
    }
  }
  const cv::Mat& raw = image.empty() ? view : image;
  if (encoding.conversion < 0) return raw.clone();
  cv::Mat colour;
  cv::cvtColor(raw, colour, encoding.conversion);
  return colour;
}

cv::Mat ImageFromMessage(const sensor_msgs::CompressedImage& message, std::string* reason) {
  return DecodeImage(std::string(message.data.begin(), message.data.end()), reason);
}

sensor_msgs::Image MessageFromImage(const cv::Mat& image, const std_msgs::Header& header) {
  DS_CHECK(image.type() == CV_8UC1 || image.type() == CV_8UC3, "type={}", image.type());
  sensor_msgs::Image message;
  message.header = header;
  message.encoding = image.channels() == 1 ? "mono8" : "bgr8";
  message.width = static_cast<uint32_t>(image.cols);
  message.height = static_cast<uint32_t>(image.rows);
  message.step = message.width * static_cast<uint32_t>(image.elemSize());
  message.data.resize(static_cast<size_t>(message.step) * message.height);
  image.copyTo(cv::Mat(image.rows, image.cols, image.type(), message.data.data()));
  return message;
}

sensor_msgs::CompressedImage CompressedFromImage(const cv::Mat& image, const std_msgs::Header& header) {
  sensor_msgs::CompressedImage message;
  message.header = header;
  message.format = "jpeg";
  cv::imencode(".jpg", image, message.data);
  return message;
}

Camera CameraFromMessage(const sensor_msgs::CameraInfo& message) {
  const std::string what = "camera_info";
  const std::string remedy = "Calibrate the camera (camera_calibration), or give ~camera a camera file.";
  if (message.K[0] == 0) throw InputError(what, "holds no calibration", remedy);
  if (message.binning_x > 1 || message.binning_y > 1) throw InputError(what, "says binning", remedy);
  const auto& roi = message.roi;
  if (roi.x_offset != 0 || roi.y_offset != 0 || (roi.width != 0 && roi.width != message.width) ||
      (roi.height != 0 && roi.height != message.height)) {
    throw InputError(what, "says a region of interest", remedy);
  }
  Camera camera;
  camera.name = message.header.frame_id.empty() ? what : message.header.frame_id;
  camera.width = static_cast<int>(message.width);
  camera.height = static_cast<int>(message.height);
  camera.fx = message.K[0];
  camera.fy = message.K[4];
  camera.cx = message.K[2];
  camera.cy = message.K[5];
  const auto coefficient = [&message](size_t i) { return i < message.D.size() ? message.D[i] : 0.0; };
  const bool distorts = std::any_of(message.D.begin(), message.D.end(), [](double d) { return d != 0; });
  const std::string& model = message.distortion_model;
  if (model == "equidistant") {
    camera.model = LensModel::kKannalaBrandt;
    camera.k1 = coefficient(0);
    camera.k2 = coefficient(1);
    camera.k3 = coefficient(2);
    camera.k4 = coefficient(3);
  } else if (model == "plumb_bob" || model == "rational_polynomial" || !distorts) {
    if (coefficient(5) != 0 || coefficient(6) != 0 || coefficient(7) != 0) {
      throw InputError(what, "has the denominator of a rational_polynomial lens", remedy);
    }
    camera.k1 = coefficient(0);
    camera.k2 = coefficient(1);
    camera.p1 = coefficient(2);
    camera.p2 = coefficient(3);
    camera.k3 = coefficient(4);
  } else {
    throw InputError(what, fmt::format("has a lens '{}', which is not known", model), remedy);
  }
  camera.Validate();
  return camera;
}

sensor_msgs::CameraInfo MessageFromCamera(const Camera& camera) {
  sensor_msgs::CameraInfo message;
  message.width = static_cast<uint32_t>(camera.width);
  message.height = static_cast<uint32_t>(camera.height);
  if (camera.model == LensModel::kKannalaBrandt) {
    message.distortion_model = "equidistant";
    message.D = {camera.k1, camera.k2, camera.k3, camera.k4};
  } else {
    message.distortion_model = "plumb_bob";
    message.D = {camera.k1, camera.k2, camera.p1, camera.p2, camera.k3};
  }
  message.K = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  message.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  message.P = {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0};
  return message;
}

geometry_msgs::Pose PoseMessage(const Rigid3& target_from_source) {
  const geometry_msgs::Transform transform = TransformMessage(target_from_source);
  geometry_msgs::Pose pose;
  pose.orientation = transform.rotation;
  pose.position.x = transform.translation.x;
  pose.position.y = transform.translation.y;
  pose.position.z = transform.translation.z;
  return pose;
}

geometry_msgs::Transform TransformMessage(const Rigid3& target_from_source) {
  geometry_msgs::Transform transform;
  transform.translation.x = target_from_source.translation.x();
  transform.translation.y = target_from_source.translation.y();
  transform.translation.z = target_from_source.translation.z();
  transform.rotation.x = target_from_source.rotation.x();
  transform.rotation.y = target_from_source.rotation.y();
  transform.rotation.z = target_from_source.rotation.z();
  transform.rotation.w = target_from_source.rotation.w();
  return transform;
}

Rigid3 RigidFromMessage(const geometry_msgs::Transform& transform) {
  const auto& q = transform.rotation;
  const auto& t = transform.translation;
  return {Eigen::Quaterniond(q.w, q.x, q.y, q.z), Eigen::Vector3d(t.x, t.y, t.z)};
}

}  // namespace dynamic_slam
