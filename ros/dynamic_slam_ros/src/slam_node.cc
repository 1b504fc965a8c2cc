// Dynamic-SLAM as a node: images in; poses, map and what is known of moving objects out. README.md has the
// topics.
//
// Everything runs on the thread that spins, images and services in turn, but what SlamSystem and ImageInput
// have threads for.

#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include <diagnostic_updater/diagnostic_updater.h>
#include <dynamic_slam_ros/GetTrajectory.h>
#include <dynamic_slam_ros/MapFile.h>
#include <fmt/core.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include "conversions.h"
#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/map/map_file.h"
#include "dynamic_slam/semantics/dynamic_prior.h"
#include "image_input.h"
#include "parameters.h"
#include "program.h"
#include "remote_detector.h"
#include "slam_outputs.h"

namespace dynamic_slam {
namespace {

using diagnostic_updater::DiagnosticStatusWrapper;
using Level = diagnostic_msgs::DiagnosticStatus;

// Half a second at 30 frames a second, as when images are read from files in realtime mode.
constexpr uint32_t kWaitingImages = 15;
constexpr double kDiagnosticsPeriodS = 1;
constexpr double kNoImagesS = 2;

struct NodeOptions {
  std::string detector = "none";
  std::string models{}, camera{}, profile{}, map{};
  bool compressed = false;
  RemoteDetectorOptions remote;
  OutputOptions outputs;

  template <class Self, class Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("detector", self.detector,
          OptionField{"", 0, 0, "`ros`: a detector_node; else as for `dynamic_slam run --detector`."});
    visit("models", self.models, OptionField{"", 0, 0, "Folder in which network files are looked for too."});
    visit("camera", self.camera,
          OptionField{"", 0, 0, "Name of a known camera, or camera file; empty: what camera_info says."});
    visit("profile", self.profile, OptionField{"", 0, 0, "YAML file with options, or a profile."});
    visit("map", self.map, OptionField{"", 0, 0, "Map file that is loaded first."});
    visit("compressed", self.compressed,
          OptionField{"", 0, 1, "Images come as files, on image/compressed, and not raw."});
    visit("remote_detector", self.remote);
    visit("outputs", self.outputs);
  }
};

class SlamNode {
 public:
  SlamNode();

 private:
  void TakeCameraInfo(const sensor_msgs::CameraInfo& message);
  std::shared_ptr<Detector> ChooseDetector() const;
  void MakeSystem(const Camera& camera);
  void TakeImage(const std_msgs::Header& header, const cv::Mat& image, const std::string& reason);
  bool IsInOrder(const std_msgs::Header& header);
  void Skip(const std::string& reason);
  void Forget();
  void ForgetAllButTheMap();

  void AddServices();
  template <class Response>
  bool Answer(Response* response, const std::function<std::string()>& action);
  SlamSystem& system();

  void DescribeTracking(DiagnosticStatusWrapper& status);
  void DescribeDetector(DiagnosticStatusWrapper& status);
  void DescribeImages(DiagnosticStatusWrapper& status);

  NodeOptions options_;
  SystemOptions system_options_;
  std::shared_ptr<Detector> detector_;  // null: none
  std::unique_ptr<SlamSystem> system_;  // once the camera is known
  std::optional<SlamOutputs> outputs_;
  std::string camera_problem_ = "no camera_info has come yet";
  std::string failure_;  // of a stage: nothing goes on until a reset
  TrackingResult tracking_;
  ros::Time last_stamp_;
  std::optional<uint32_t> last_seq_;
  ros::WallTime last_image_ = ros::WallTime::now();
  int images_ = 0, skipped_ = 0, dropped_ = 0;
  std::string skip_reason_;
  DetectionReport told_;  // with the last diagnostics

  ros::NodeHandle node_, private_node_{"~"};
  diagnostic_updater::Updater updater_;
  std::vector<ros::ServiceServer> services_;
  ros::Subscriber camera_info_;
  std::optional<ImageInput> input_;
  ros::WallTimer diagnostics_timer_, map_timer_;
};

SlamNode::SlamNode() {
  ReadParameters(private_node_, CollectOptions(options_), {"options", "diagnostic_period"});
  if (!options_.profile.empty()) {
    LoadOptions(FindConfig("profiles", "options", options_.profile), &system_options_);
  }
  ReadParameters(ros::NodeHandle("~options"), CollectOptions(system_options_));
  CheckOptions(system_options_);
  detector_ = ChooseDetector();
  if (!options_.camera.empty()) {
    MakeSystem(LoadCamera(options_.camera));
  } else {
    camera_info_ = node_.subscribe("camera_info", 1, &SlamNode::TakeCameraInfo, this);
  }
  AddServices();
  updater_.setHardwareID("none");
  updater_.add("tracking", this, &SlamNode::DescribeTracking);
  updater_.add("detector", this, &SlamNode::DescribeDetector);
  updater_.add("images", this, &SlamNode::DescribeImages);
  input_.emplace("image", options_.compressed, kWaitingImages,
                 [this](const auto& header, const auto& image, const auto& reason) {
                   TakeImage(header, image, reason);
                 });
  // By the wall: while nothing plays, ROS's time may stand still.
  diagnostics_timer_ =
      node_.createWallTimer(ros::WallDuration(kDiagnosticsPeriodS),
                            boost::function<void(const ros::WallTimerEvent&)>(
                                [this](const ros::WallTimerEvent&) { updater_.force_update(); }));
  map_timer_ = node_.createWallTimer(
      ros::WallDuration(options_.outputs.map_period_s),
      boost::function<void(const ros::WallTimerEvent&)>([this](const ros::WallTimerEvent&) {
        if (outputs_.has_value()) outputs_->PublishMap(*system_);
      }));
}

void SlamNode::TakeCameraInfo(const sensor_msgs::CameraInfo& message) {
  if (system_ != nullptr) return;
  try {
    MakeSystem(CameraFromMessage(message));
  } catch (const InputError& error) {
    camera_problem_ = error.what();
    ROS_ERROR_THROTTLE(5, "%s", error.what());
  }
}

std::shared_ptr<Detector> SlamNode::ChooseDetector() const {
  if (options_.detector != "ros") return MakeDetector(options_.detector, options_.models);
  std::vector<std::string> class_names;
  for (const auto& [name, score] : LoadDynamicPrior(system_options_.detector.prior).score_of_class) {
    class_names.push_back(name);
  }
  return MakeRemoteDetector(options_.remote, std::move(class_names));
}

void SlamNode::MakeSystem(const Camera& camera) {
  auto system = std::make_unique<SlamSystem>(camera, system_options_, RunMode::kRealtime);
  system->SetDetector(detector_);
  if (!options_.map.empty()) system->LoadMap(ReadMapFile(options_.map), options_.map);
  outputs_.emplace(camera, system_options_.image, options_.outputs);
  system_ = std::move(system);
  camera_problem_.clear();
  ROS_INFO("camera %s, %d x %d px; detector %s", camera.name.c_str(), camera.width, camera.height,
           options_.detector.c_str());
}

bool SlamNode::IsInOrder(const std_msgs::Header& header) {
  constexpr double kRestartS = 1;
  if (last_seq_.has_value() && header.seq > *last_seq_) {
    dropped_ += static_cast<int>(std::min(header.seq - *last_seq_ - 1, 1000u));
  }
  last_seq_ = header.seq;
  if (header.stamp > last_stamp_) return true;
  if ((last_stamp_ - header.stamp).toSec() < kRestartS) {
    Skip(fmt::format("its stamp {:.6f} does not come after {:.6f}", header.stamp.toSec(),
                     last_stamp_.toSec()));
    return false;
  }
  ForgetAllButTheMap();
  return true;
}

void SlamNode::Skip(const std::string& reason) {
  ++skipped_;
  skip_reason_ = reason;
  ROS_WARN_THROTTLE(5, "an image is left out: %s", reason.c_str());
}

void SlamNode::TakeImage(const std_msgs::Header& message_header, const cv::Mat& image,
                         const std::string& reason) {
  last_image_ = ros::WallTime::now();
  ++images_;
  if (system_ == nullptr || !failure_.empty()) return;
  if (image.empty()) return Skip(reason);
  if (const std::string refusal = system_->preparer().Refusal(image); !refusal.empty()) return Skip(refusal);
  if (!IsInOrder(message_header)) return;
  std_msgs::Header header = message_header;
  if (header.frame_id.empty()) header.frame_id = "camera_optical";
  last_stamp_ = header.stamp;
  try {
    const FrameResult result = system_->Process(StampSeconds(header.stamp), image);
    if (result.tracking.state != tracking_.state) {
      ROS_INFO("%s %s", Name(result.tracking.state), result.tracking.reason.c_str());
    }
    tracking_ = result.tracking;
    outputs_->Publish(header, image, result, *system_);
  } catch (const std::exception& error) {
    failure_ = error.what();
    ROS_ERROR("%s: call the service reset", error.what());
  }
}

void SlamNode::Forget() {
  system_->Reset();
  if (system_->options().tracker.localise_only) system_->SetLocaliseOnly(false);
  outputs_->Forget();
  failure_.clear();
  tracking_ = {};
  told_ = {};
  last_stamp_ = {};
}

// The clock went back, as when a bag is played again: what is known of time is void, the map is not.
void SlamNode::ForgetAllButTheMap() {
  const bool localises_only = system_->options().tracker.localise_only;
  std::string bytes;
  size_t keyframes = 0;
  {
    const auto map = system_->map().Read();
    keyframes = map->keyframes().size();
    if (keyframes > 0) bytes = EncodeMap(system_->camera(), *map);
  }
  Forget();
  if (keyframes == 0) {
    ROS_WARN("the stamps begin again; there is no map yet");
    return;
  }
  try {
    system_->LoadMap(DecodeMap(bytes, "the map"), "the map");
    if (localises_only) system_->SetLocaliseOnly(true);
    ROS_WARN(
        "the stamps begin again: the map of %zu keyframes is kept, and the camera is looked for in it; "
        "the path begins anew. For a new map, call the service reset",
        keyframes);
  } catch (const InputError& error) {
    ROS_WARN("the stamps begin again, and so does the map: %s", error.what());
  }
}

SlamSystem& SlamNode::system() {
  if (system_ == nullptr) throw InputError("there is no camera yet", camera_problem_, "");
  return *system_;
}

// What `action` says is the message; what it throws is the reason why there was no success.
template <class Response>
bool SlamNode::Answer(Response* response, const std::function<std::string()>& action) {
  try {
    response->message = action();
    response->success = true;
  } catch (const std::exception& error) {
    response->message = error.what();
    response->success = false;
  }
  return true;
}

void SlamNode::AddServices() {
  const auto add = [this]<class Service>(const std::string& name, auto action, Service*) {
    using Request = typename Service::Request;
    using Response = typename Service::Response;
    services_.push_back(private_node_.advertiseService<Request, Response>(
        name,
        boost::function<bool(Request&, Response&)>([this, action](Request& request, Response& response) {
          return Answer(&response, [&] { return action(request, &response); });
        })));
  };
  using std_srvs::SetBool, std_srvs::Trigger, dynamic_slam_ros::MapFile, dynamic_slam_ros::GetTrajectory;
  add(
      "reset",
      [this](const Trigger::Request&, Trigger::Response*) -> std::string {
        system();
        Forget();
        return "the map is empty";
      },
      static_cast<Trigger*>(nullptr));
  add(
      "save_map",
      [this](const MapFile::Request& request, MapFile::Response*) {
        const auto map = system().map().Read();
        if (map->keyframes().size() == 0)
          throw InputError(request.file, "there is no map to save", "Make one first.");
        WriteMapFile(request.file, system().camera(), *map);
        return fmt::format("{} keyframes, {} landmarks", map->keyframes().size(), map->landmarks().size());
      },
      static_cast<MapFile*>(nullptr));
  add(
      "load_map",
      [this](const MapFile::Request& request, MapFile::Response*) {
        SavedMap saved = ReadMapFile(request.file);
        CheckMapFits(saved, system().camera(), system().map().Read()->octave_scales(), request.file);
        Forget();
        const size_t keyframes = saved.map.keyframes().size();
        system().LoadMap(std::move(saved), request.file);
        return fmt::format("{} keyframes", keyframes);
      },
      static_cast<MapFile*>(nullptr));
  add(
      "set_localise_only",
      [this](const SetBool::Request& request, SetBool::Response*) -> std::string {
        system().SetLocaliseOnly(request.data != 0);
        return request.data != 0 ? "the map stays as it is" : "the map grows";
      },
      static_cast<SetBool*>(nullptr));
  add(
      "get_trajectory",
      [this](const GetTrajectory::Request&, GetTrajectory::Response* response) {
        for (const PartId part : system().Parts()) {
          response->parts.push_back(outputs_->Path(system().FrameTrajectory(part), part));
        }
        return fmt::format("{} parts", response->parts.size());
      },
      static_cast<GetTrajectory*>(nullptr));
}

void SlamNode::DescribeTracking(DiagnosticStatusWrapper& status) {
  if (system_ == nullptr) return status.summary(Level::ERROR, camera_problem_);
  if (!failure_.empty()) return status.summary(Level::ERROR, failure_ + ": call the service reset");
  const bool is_tracking = tracking_.state == TrackingState::kTracking;
  if (is_tracking && !outputs_->problem().empty()) {
    status.summary(Level::ERROR, outputs_->problem());
  } else {
    const std::string reason = tracking_.reason.empty() ? Name(tracking_.state) : tracking_.reason;
    status.summary(is_tracking                               ? Level::OK
                   : tracking_.state == TrackingState::kLost ? Level::ERROR
                                                             : Level::WARN,
                   reason);
  }
  status.add("state", Name(tracking_.state));
  status.add("inliers", tracking_.inliers);
  status.add("localise only", system_->options().tracker.localise_only);
  const auto map = system_->map().Read();
  status.add("keyframes", map->keyframes().size());
  status.add("landmarks", map->landmarks().size());
}

void SlamNode::DescribeDetector(DiagnosticStatusWrapper& status) {
  const auto report = system_ == nullptr ? std::nullopt : system_->detection_report();
  if (!report.has_value()) return status.summary(Level::OK, "none");
  const int failed = report->failed - told_.failed;
  const int answered = report->on_time + report->late - told_.on_time - told_.late;
  if (failed > 0) {
    status.summary(Level::WARN, fmt::format("{} answers failed since the last time, boxes are predicted: {}",
                                            failed, report->last_failure));
  } else if (answered == 0 && report->asked > 0) {
    status.summary(Level::WARN, "no answers since the last time, boxes are predicted");
  } else {
    status.summary(Level::OK, fmt::format("{} answers since the last time", answered));
  }
  status.add("detector", system_->detector()->name());
  status.add("asked", report->asked);
  status.add("on time", report->on_time);
  status.add("late", report->late);
  status.add("failed", report->failed);
  told_ = *report;
}

void SlamNode::DescribeImages(DiagnosticStatusWrapper& status) {
  const double quiet_s = (ros::WallTime::now() - last_image_).toSec();
  if (quiet_s > kNoImagesS) {
    status.summary(Level::WARN, fmt::format("no image on {} for {:.0f} s", input_->topic(), quiet_s));
  } else if (!skip_reason_.empty()) {
    status.summary(Level::WARN, "images are left out: " + skip_reason_);
  } else {
    status.summary(Level::OK, "images come");
  }
  status.add("images", images_);
  status.add("left out", skipped_);
  status.add("missing by their numbers", dropped_);
  skip_reason_.clear();
}

}  // namespace
}  // namespace dynamic_slam

int main(int argc, char** argv) {
  ros::init(argc, argv, "slam_node");
  return dynamic_slam::RunProgram([] {
    const dynamic_slam::SlamNode node;
    ros::spin();
    return 0;
  });
}
