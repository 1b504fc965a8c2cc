#include "dynamic_slam/system.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "dynamic_slam/api/map_contents.h"
#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/map/map_file.h"
#include "dynamic_slam/system/slam_system.h"

namespace dynamic_slam {
namespace {

SystemOptions ReadOptions(const Options& options) {
  SystemOptions values;
  if (!options.config.empty()) LoadOptions(FindConfig("profiles", "options", options.config), &values);
  ApplySet(&values, options.set);
  values.tracker.localise_only |= options.localise_only;
  if (values.tracker.localise_only && options.map.empty()) {
    throw InputError("Options::localise_only", "there is no map to localise in", "Name one in Options::map.");
  }
  return values;
}

ImageObject ToObject(const DynamicBox& box, const std::vector<std::string>& class_names) {
  return {box.box.x,
          box.box.y,
          box.box.width,
          box.box.height,
          class_names.at(static_cast<size_t>(box.class_id)),
          box.score,
          box.track_id,
          box.is_detected,
          box.is_dynamic};
}

}  // namespace

struct System::Impl {
  Impl(const Camera& camera, const Options& options) : slam(camera, ReadOptions(options), options.mode) {
    slam.SetDetector(MakeDetector(options.detector, options.models));
    if (!options.map.empty()) slam.LoadMap(ReadMapFile(options.map), options.map);
  }

  PartId Part(size_t number) const {
    const std::vector<PartId> parts = slam.Parts();
    return number < parts.size() ? parts[number] : PartId();
  }

  SlamSystem slam;
  std::optional<double> last_stamp_s;
  bool is_finished = false;
};

System::System(const Camera& camera, const Options& options)
    : impl_(std::make_unique<Impl>(camera, options)) {}
System::~System() = default;
System::System(System&&) noexcept = default;
System& System::operator=(System&&) noexcept = default;

ImageResult System::Process(double timestamp_s, const cv::Mat& image, const cv::Mat& mask) {
  SlamSystem& slam = impl_->slam;
  if (impl_->is_finished) {
    throw InputError("an image after Finish", "the map is final", "Call Reset to begin anew.");
  }
  if (!std::isfinite(timestamp_s) || (impl_->last_stamp_s && timestamp_s <= *impl_->last_stamp_s)) {
    throw InputError(fmt::format("an image's stamp, {} s", timestamp_s),
                     impl_->last_stamp_s
                         ? fmt::format("is not after that of the last image, {} s", *impl_->last_stamp_s)
                         : "is no time",
                     "Give the images in their order.");
  }
  const Camera& prepared = slam.camera();
  if (!mask.empty() && (mask.type() != CV_8UC1 || mask.size() != cv::Size(prepared.width, prepared.height))) {
    throw InputError(
        "a mask",
        fmt::format("is {} x {} px with {} channels of {} bytes", mask.cols, mask.rows, mask.channels(),
                    mask.elemSize1()),
        fmt::format("It must be {} x {} px with one channel of 8 bits.", prepared.width, prepared.height));
  }
  const FrameResult frame = slam.Process(timestamp_s, image, mask);
  impl_->last_stamp_s = timestamp_s;

  ImageResult result;
  result.timestamp_s = timestamp_s;
  result.state = frame.tracking.state;
  result.reason = frame.tracking.reason;
  result.keypoints = frame.tracking.keypoints;
  result.inliers = frame.tracking.inliers;
  result.is_keyframe = !frame.tracking.new_keyframes.empty();
  result.tracking_ms = frame.tracking_ms;
  for (const DynamicBox& box : frame.objects.boxes) {
    result.objects.push_back(ToObject(box, slam.detector()->class_names()));
  }
  if (frame.tracking.state == TrackingState::kTracking) {
    const auto map = slam.map().Read();
    const Frame& tracked = slam.frame();
    if (map->PartOf(tracked.reference).IsValid()) {
      result.world_from_cam = map->PoseFromReference(tracked.reference, tracked.cam_from_reference).Inverse();
    }
  }
  return result;
}

void System::Finish() {
  if (std::exchange(impl_->is_finished, true)) return;
  impl_->slam.Finish();
}

void System::Reset() {
  impl_->slam.Reset();
  impl_->last_stamp_s.reset();
  impl_->is_finished = false;
}

size_t System::PartCount() const { return impl_->slam.Parts().size(); }

Trajectory System::Poses(size_t part) const {
  const PartId id = impl_->Part(part);
  return id.IsValid() ? impl_->slam.FrameTrajectory(id) : Trajectory();
}

Trajectory System::KeyframePoses(size_t part) const {
  const PartId id = impl_->Part(part);
  return id.IsValid() ? impl_->slam.KeyframeTrajectory(id) : Trajectory();
}

MapView System::Map() const { return ContentsOf(camera(), *impl_->slam.map().Read()); }

void System::SaveMap(const std::filesystem::path& file) const {
  WriteMapFile(file, camera(), *impl_->slam.map().Read());
}

std::string System::ConfigYaml() const { return OptionsToYaml(impl_->slam.options()); }

const Camera& System::camera() const { return impl_->slam.camera(); }

}  // namespace dynamic_slam
