#include "slam_outputs.h"

#include <cstring>

#include <dynamic_slam_ros/Objects.h>
#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/PointCloud2.h>

#include "conversions.h"
#include "dynamic_slam/report/frame_picture.h"
#include "dynamic_slam/semantics/selective_tracking.h"

namespace dynamic_slam {
namespace {

// Axes of a robot (x forward, y left, z up) from those of a camera (z forward, x right, y down): REP 103.
Rigid3 BodyFromOptical() {
  Eigen::Matrix3d R;
  R << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {R, Eigen::Vector3d::Zero()};
}

sensor_msgs::PointCloud2 Cloud(const std::vector<Eigen::Vector3f>& points, const std_msgs::Header& header) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header = header;
  cloud.height = 1;
  cloud.width = static_cast<uint32_t>(points.size());
  for (const char* name : {"x", "y", "z"}) {
    sensor_msgs::PointField& field = cloud.fields.emplace_back();
    field.name = name;
    field.offset = static_cast<uint32_t>(sizeof(float) * (cloud.fields.size() - 1));
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
  }
  cloud.point_step = sizeof(Eigen::Vector3f);
  cloud.row_step = cloud.point_step * cloud.width;
  cloud.is_dense = true;
  cloud.data.resize(cloud.row_step);
  if (!points.empty()) std::memcpy(cloud.data.data(), points.data(), cloud.data.size());
  return cloud;
}

Rigid3 Scaled(const Rigid3& pose, double factor) { return {pose.rotation, factor * pose.translation}; }

}  // namespace

SlamOutputs::SlamOutputs(const Camera& raw_camera, const ImageOptions& image_options,
                         const OutputOptions& options)
    : options_(options), preparer_(raw_camera, image_options) {
  ros::NodeHandle node("~");
  pose_ = node.advertise<geometry_msgs::PoseStamped>("pose", 10);
  odometry_ = node.advertise<nav_msgs::Odometry>("odometry", 10);
  path_topic_ = node.advertise<nav_msgs::Path>("path", 1, /*latch=*/true);
  points_ = node.advertise<sensor_msgs::PointCloud2>("points", 1, true);
  keyframes_ = node.advertise<geometry_msgs::PoseArray>("keyframes", 1, true);
  picture_ = node.advertise<sensor_msgs::Image>("image", 1);
  mask_ = node.advertise<sensor_msgs::Image>("mask", 1);
  objects_ = node.advertise<dynamic_slam_ros::Objects>("objects", 10);
  if (!options_.base_frame.empty()) listener_.emplace(buffer_);
}

void SlamOutputs::Publish(const std_msgs::Header& header, const cv::Mat& image, const FrameResult& result,
                          const SlamSystem& system) {
  problem_.clear();
  if (result.tracking.state != TrackingState::kTracking) {
    path_.Break();
  } else if (FindBase(header.frame_id)) {
    PublishPose(header, system.frame(), system.map());
  }
  if (system.detector() != nullptr) PublishObjects(header, result, system);
  if (picture_.getNumSubscribers() > 0) PublishPicture(header, image, result, system);
}

bool SlamOutputs::FindBase(const std::string& camera_frame) {
  if (options_.base_frame.empty()) return true;
  try {
    base_from_cam_ =
        RigidFromMessage(buffer_.lookupTransform(options_.base_frame, camera_frame, ros::Time(0)).transform);
  } catch (const tf2::TransformException& error) {
    problem_ = error.what();
    path_.Break();
  }
  return problem_.empty();
}

// The map's frame is where the base, or else the camera with a robot's axes, was in the first keyframe.
Rigid3 SlamOutputs::MapFromBase(const Rigid3& world_from_cam) const {
  const Rigid3 metric = Scaled(world_from_cam, options_.metres_per_unit);
  if (options_.base_frame.empty()) return BodyFromOptical() * metric;
  return base_from_cam_ * metric * base_from_cam_.Inverse();
}

void SlamOutputs::PublishPose(const std_msgs::Header& header, const Frame& frame,
                              const SharedMap& shared_map) {
  bool is_jump = false;
  Rigid3 world_from_cam;
  {
    const auto map = shared_map.Read();
    const PartId part = map->PartOf(frame.reference);
    if (!part.IsValid()) return;  // given up since
    is_jump = part != part_ || map->epoch() != epoch_ || map->revision() != revision_;
    part_ = part;
    epoch_ = map->epoch();
    revision_ = map->revision();
    world_from_cam = map->PoseFromReference(frame.reference, frame.cam_from_reference).Inverse();
  }
  const Rigid3 map_from_base = MapFromBase(world_from_cam);
  path_.Add(map_from_base, is_jump);

  geometry_msgs::PoseStamped pose;
  pose.header.stamp = header.stamp;
  pose.header.frame_id = options_.map_frame;
  pose.pose = PoseMessage(map_from_base);
  pose_.publish(pose);

  nav_msgs::Odometry odometry;
  odometry.header.stamp = header.stamp;
  odometry.header.frame_id = options_.odom_frame;
  odometry.child_frame_id = options_.base_frame.empty() ? header.frame_id : options_.base_frame;
  odometry.pose.pose = PoseMessage(path_.odom_from_body());
  const double dt_s = (header.stamp - last_stamp_).toSec();
  if (path_.last_from_body().has_value() && dt_s > 0) {
    const Eigen::Vector3d linear = path_.last_from_body()->translation / dt_s;
    const Eigen::Vector3d angular = LogSo3(path_.last_from_body()->rotation) / dt_s;
    geometry_msgs::Twist& twist = odometry.twist.twist;
    twist.linear.x = linear.x();
    twist.linear.y = linear.y();
    twist.linear.z = linear.z();
    twist.angular.x = angular.x();
    twist.angular.y = angular.y();
    twist.angular.z = angular.z();
  }
  last_stamp_ = header.stamp;
  odometry_.publish(odometry);

  if (!options_.publish_tf) return;
  geometry_msgs::TransformStamped map_to_odom, odom_to_base;
  map_to_odom.header = pose.header;
  map_to_odom.child_frame_id = options_.odom_frame;
  map_to_odom.transform = TransformMessage(path_.map_from_odom());
  odom_to_base.header = odometry.header;
  odom_to_base.child_frame_id = odometry.child_frame_id;
  odom_to_base.transform = TransformMessage(path_.odom_from_body());
  broadcaster_.sendTransform({map_to_odom, odom_to_base});
}

void SlamOutputs::PublishObjects(const std_msgs::Header& header, const FrameResult& result,
                                 const SlamSystem& system) {
  dynamic_slam_ros::Objects message;
  message.header = header;
  message.detector_state = Name(result.objects.state);
  message.reason = result.objects.reason;
  std::vector<Box> dynamic_boxes;
  for (const DynamicBox& object : result.objects.boxes) {
    dynamic_slam_ros::Object& said = message.objects.emplace_back();
    said.detection.class_name = system.detector()->class_names()[static_cast<size_t>(object.class_id)];
    said.detection.score = object.score;
    said.detection.x = object.box.x;
    said.detection.y = object.box.y;
    said.detection.width = object.box.width;
    said.detection.height = object.box.height;
    said.track = object.track_id;
    said.is_detected = object.is_detected;
    said.dynamic_score = object.dynamic_score;
    said.is_dynamic = object.is_dynamic;
    if (object.is_dynamic) dynamic_boxes.push_back(object.box);
  }
  objects_.publish(message);
  if (mask_.getNumSubscribers() == 0) return;
  const Camera& camera = preparer_.camera();
  mask_.publish(MessageFromImage(DynamicMask(dynamic_boxes, camera.width, camera.height), header));
}

void SlamOutputs::PublishPicture(const std_msgs::Header& header, const cv::Mat& image,
                                 const FrameResult& result, const SlamSystem& system) {
  cv::Mat picture;
  preparer_.PrepareColour(image, &picture);
  RunProgress progress;
  progress.result = &result;
  progress.frame_in_work = &system.frame();
  progress.detector = system.detector();
  DrawFrame(progress, &picture);
  picture_.publish(MessageFromImage(picture, header));
}

std_msgs::Header SlamOutputs::MapHeader() const {
  std_msgs::Header header;
  header.stamp = last_stamp_;
  header.frame_id = options_.map_frame;
  return header;
}

nav_msgs::Path SlamOutputs::Path(const Trajectory& trajectory) const {
  nav_msgs::Path path;
  path.header = MapHeader();
  path.poses.resize(trajectory.size());
  for (size_t i = 0; i < trajectory.size(); ++i) {
    path.poses[i].header.frame_id = options_.map_frame;
    path.poses[i].header.stamp = StampFromSeconds(trajectory[i].timestamp_s);
    path.poses[i].pose = PoseMessage(MapFromBase(trajectory[i].world_from_cam));
  }
  return path;
}

void SlamOutputs::PublishMap(const SlamSystem& system) {
  if (!part_.IsValid()) return;
  if (path_topic_.getNumSubscribers() > 0) path_topic_.publish(Path(system.FrameTrajectory(part_)));
  if (points_.getNumSubscribers() == 0 && keyframes_.getNumSubscribers() == 0) return;
  // A rigid transform of the world, and a scale.
  const Rigid3 map_from_world = options_.base_frame.empty() ? BodyFromOptical() : base_from_cam_;
  std::vector<Eigen::Vector3f> points;
  geometry_msgs::PoseArray keyframes;
  keyframes.header = MapHeader();
  {
    const auto map = system.map().Read();
    map->landmarks().ForEach([&](const Landmark& landmark) {
      if (map->PartOf(landmark) != part_) return;
      points.push_back((map_from_world * (options_.metres_per_unit * landmark.position())).cast<float>());
    });
    map->keyframes().ForEach([&](const Keyframe& keyframe) {
      if (keyframe.part() != part_) return;
      keyframes.poses.push_back(PoseMessage(MapFromBase(keyframe.cam_from_world().Inverse())));
    });
  }
  points_.publish(Cloud(points, MapHeader()));
  keyframes_.publish(keyframes);
}

}  // namespace dynamic_slam
