#pragma once

#include <optional>
#include <string>

#include <nav_msgs/Path.h>
#include <ros/node_handle.h>
#include <std_msgs/Header.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include "continuous_path.h"
#include "dynamic_slam/base/option_field.h"
#include "dynamic_slam/io/image_preparer.h"
#include "dynamic_slam/system/slam_system.h"

namespace dynamic_slam {

struct OutputOptions {
  std::string map_frame = "map", odom_frame = "odom", base_frame{};
  double metres_per_unit = 1;
  double map_period_s = 1;
  bool publish_tf = true;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("map_frame", self.map_frame, OptionField{"", 0, 0, "Name of the map's frame."});
    visit("odom_frame", self.odom_frame, OptionField{"", 0, 0, "Name of the frame of odometry."});
    visit("base_frame", self.base_frame,
          OptionField{
              "", 0, 0,
              "The robot's frame, whose pose is published; tf must know where the camera is in it. Empty: "
              "the camera's own frame."});
    visit("metres_per_unit", self.metres_per_unit,
          OptionField{"m", 1e-6, 1e6,
                      "All that is published is multiplied by it: one camera cannot know the scale."});
    visit("map_period_s", self.map_period_s,
          OptionField{"s", 0.05, 3600, "Time between two of points, keyframes and path."});
    visit("publish_tf", self.publish_tf,
          OptionField{"", 0, 1, "Publish map -> odom -> base (or camera) on tf."});
  }
};

// What slam_node publishes of a run. Frames as REP 103 and REP 105 have them: in the map z is up, as far as
// it was for the camera when the map was begun.
class SlamOutputs {
 public:
  // Of images of this camera, prepared with these options.
  SlamOutputs(const Camera& raw_camera, const ImageOptions& image_options, const OutputOptions& options);

  // After each image.
  void Publish(const std_msgs::Header& header, const cv::Mat& image, const FrameResult& result,
               const SlamSystem& system);

  // Points, keyframes and path of the part of the map in which the camera was last.
  void PublishMap(const SlamSystem& system);

  nav_msgs::Path Path(const Trajectory& trajectory) const;

  // The map was given up: the next pose has nothing to do with the last one.
  void Break() { path_.Break(); }

  // Why there is no pose although the camera has one, or "".
  const std::string& problem() const { return problem_; }

 private:
  void PublishPose(const std_msgs::Header& header, const Frame& frame, const SharedMap& map);
  void PublishObjects(const std_msgs::Header& header, const FrameResult& result, const SlamSystem& system);
  void PublishPicture(const std_msgs::Header& header, const cv::Mat& image, const FrameResult& result,
                      const SlamSystem& system);
  std_msgs::Header MapHeader() const;
  Rigid3 MapFromBase(const Rigid3& world_from_cam) const;
  bool FindBase(const std::string& camera_frame);

  OutputOptions options_;
  ImagePreparer preparer_;
  ros::Publisher pose_, odometry_, path_topic_, points_, keyframes_, picture_, mask_, objects_;
  tf2_ros::TransformBroadcaster broadcaster_;
  tf2_ros::Buffer buffer_;
  std::optional<tf2_ros::TransformListener> listener_;  // with a base frame
  Rigid3 base_from_cam_;
  std::string problem_;
  ContinuousPath path_;
  PartId part_;
  uint32_t epoch_ = 0, revision_ = 0;  // of the map, at the last pose
  ros::Time last_stamp_;               // of the last pose
};

}  // namespace dynamic_slam
