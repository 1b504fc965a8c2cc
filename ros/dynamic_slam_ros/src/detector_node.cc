// A detector for slam_node, here or on another machine: what it sees in each image that it is sent.

#include <memory>
#include <string>

#include <dynamic_slam_ros/Detections.h>
#include <fmt/core.h>
#include <ros/ros.h>

#include "conversions.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/detector_factory.h"
#include "image_input.h"
#include "parameters.h"
#include "program.h"

namespace dynamic_slam {
namespace {

struct DetectorNodeOptions {
  std::string detector = "builtin";
  std::string models{};
  bool compressed = true;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("detector", self.detector, OptionField{"", 0, 0, "As for `dynamic_slam run --detector`."});
    visit("models", self.models, OptionField{"", 0, 0, "Folder in which network files are looked for too."});
    visit("compressed", self.compressed,
          OptionField{"", 0, 1, "Images come as files, on detector/image/compressed, and not raw."});
  }
};

int Run() {
  ros::NodeHandle node;
  DetectorNodeOptions options;
  ReadParameters(ros::NodeHandle("~"), CollectOptions(options));
  const std::unique_ptr<Detector> detector = MakeDetector(options.detector, options.models);
  if (detector == nullptr) throw InputError("~detector", "is none", "Name one.");
  ros::Publisher answers = node.advertise<dynamic_slam_ros::Detections>("detector/detections", 5);
  uint32_t count = 0;
  // Only the newest image waits: an answer that is late helps less than the next one.
  const ImageInput input(
      &node, "detector/image", options.compressed, 1,
      [&](const std_msgs::Header& header, const cv::Mat& image, const std::string& reason) {
        dynamic_slam_ros::Detections answer;
        answer.header = header;
        answer.failure = reason;
        if (!image.empty()) {
          try {
            for (const Detection& d : detector->Detect(image, FrameId(count++), StampSeconds(header.stamp))) {
              dynamic_slam_ros::Detection& said = answer.detections.emplace_back();
              said.class_name = detector->class_names()[static_cast<size_t>(d.class_id)];
              said.score = d.score;
              said.x = d.box.x;
              said.y = d.box.y;
              said.width = d.box.width;
              said.height = d.box.height;
            }
          } catch (const std::exception& error) {
            answer.detections.clear();
            answer.failure = error.what();
          }
        }
        if (!answer.failure.empty()) ROS_WARN_THROTTLE(5, "%s", answer.failure.c_str());
        answers.publish(answer);
      });
  ROS_INFO("detector %s on %s", detector->name().c_str(), input.topic().c_str());
  ros::spin();
  return 0;
}

}  // namespace
}  // namespace dynamic_slam

int main(int argc, char** argv) {
  ros::init(argc, argv, "detector_node");
  return dynamic_slam::RunProgram(dynamic_slam::Run);
}
