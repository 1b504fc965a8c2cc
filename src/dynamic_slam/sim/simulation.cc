#include "dynamic_slam/sim/simulation.h"

#include <algorithm>
#include <cmath>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/sim/camera_effects.h"
#include "dynamic_slam/sim/room.h"
#include "dynamic_slam/sim/texture.h"

namespace dynamic_slam {
namespace {

enum SeedPart : uint64_t { kMotion = 50, kNoise, kDrops };  // parts of the seed

SceneOptions Checked(const SceneOptions& options) {
  CheckOptions(options);
  return options;
}

Camera MakeCamera(const CameraOptions& options) {
  Camera camera = options.model.empty() ? DefaultRoomCamera() : LoadCamera(options.model);
  if (options.fps > 0) camera.fps = options.fps;
  if (!(camera.fps > 0)) {
    throw InputError(fmt::format("camera '{}'", camera.name), "has no frame rate",
                     "State its fps, or camera.fps in the scene.");
  }
  return camera;
}

World MakeWorld(const SceneOptions& options) {
  if (options.world.kind == "street") return MakeStreet(options);
  if (options.world.kind == "corridor") return MakeCorridor(options);
  return MakeOffice(options);
}

class SimulationSource : public FrameSource {
 public:
  explicit SimulationSource(const Simulation& simulation) : simulation_(simulation) {
    for (int i = 0; i < simulation.options().frames; ++i) {
      if (!simulation.IsDropped(i)) frames_.push_back(i);
    }
  }

  std::optional<SourceImage> Next() override {
    if (next_ >= frames_.size()) return std::nullopt;
    const int index = frames_[next_++];
    return SourceImage{simulation_.truth()[index].timestamp_s, simulation_.Frame(index).image,
                       fmt::format("frame {}", index)};
  }
  size_t FrameCount() const override { return frames_.size(); }
  std::string Layout() const override { return "simulated"; }
  std::optional<Camera> OwnCamera() const override { return simulation_.camera(); }
  cv::Size ImageSize() const override { return {simulation_.camera().width, simulation_.camera().height}; }
  const std::vector<SourceProblem>& Problems() const override { return no_problems_; }

 private:
  const Simulation& simulation_;
  std::vector<int> frames_;
  size_t next_ = 0;
  std::vector<SourceProblem> no_problems_;
};

}  // namespace

// Everything where it is at one time.
struct Simulation::Moment {
  std::vector<MeshInstance> movers;
  std::vector<const MeshInstance*> all;
  std::vector<GroundShadow> shadows;
};

Simulation::Simulation(const SceneOptions& options)
    : options_(Checked(options)),
      world_(MakeWorld(options)),
      actors_(MakeActors(options, world_)),
      renderer_(MakeCamera(options.camera)),
      motion_(options.camera, world_, SubSeed(options.seed, kMotion)) {
  for (int i = 0; i < options.frames; ++i) {
    const double time_s = i / camera().fps;
    truth_.push_back({time_s, motion_.At(time_s)});
  }
}

bool Simulation::IsDropped(int index) const {
  if (index == 0 || options_.effects.drop_share <= 0) return false;
  return Random(SubSeed(SubSeed(options_.seed, kDrops), static_cast<uint64_t>(index))).Uniform() <
         options_.effects.drop_share;
}

Simulation::Moment Simulation::At(double time_s) const {
  Moment moment;
  for (const auto& actor : actors_) actor->Place(time_s, &moment.movers, &moment.shadows);
  moment.all.reserve(world_.statics.size() + moment.movers.size());
  for (const MeshInstance& instance : world_.statics) moment.all.push_back(&instance);
  for (const MeshInstance& instance : moment.movers) moment.all.push_back(&instance);
  return moment;
}

RenderedView Simulation::RenderMoment(const Moment& moment, const Rigid3& world_from_cam) const {
  std::vector<GroundShadow> shadows;  // those that can be seen as such
  constexpr float kFar = 45;          // m
  const Eigen::Vector2f centre = world_from_cam.translation.head<2>().cast<float>();
  for (const GroundShadow& shadow : moment.shadows) {
    if ((shadow.centre - centre).norm() < kFar) shadows.push_back(shadow);
  }
  return renderer_.Render(moment.all, shadows, world_.lighting, world_from_cam);
}

RenderedView Simulation::Render(double time_s, const Rigid3& world_from_cam) const {
  return RenderMoment(At(time_s), world_from_cam);
}

int Simulation::ExposureSamples(int index) const {
  const double exposure_s = 1e-3 * options_.effects.exposure_ms, time_s = truth_[index].timestamp_s;
  if (exposure_s <= 0) return 1;
  const Rigid3 first = motion_.At(time_s - 0.5 * exposure_s), last = motion_.At(time_s + 0.5 * exposure_s);
  // Of things 2 m away and of people; what lies ahead moves less when the camera moves towards it.
  const double near_m = 2.0, walking_m = 0.5 * exposure_s;
  const Eigen::Vector3d step = first.rotation.conjugate() * (last.translation - first.translation);
  const double motion_rad = RotationAngle(first.rotation, last.rotation) +
                            (step.head<2>().norm() + 0.4 * std::abs(step.z()) + walking_m) / near_m;
  constexpr double kStepPx = 3.0;  // between two of the pictures that are averaged
  return std::clamp(static_cast<int>(std::lround(motion_rad * camera().fx / kStepPx)), 1, 8);
}

SimulatedFrame Simulation::Frame(int index) const {
  DS_CHECK(index >= 0 && index < options_.frames, "index={} frames={}", index, options_.frames);
  const double time_s = truth_[index].timestamp_s, exposure_s = 1e-3 * options_.effects.exposure_ms;
  const int samples = ExposureSamples(index);
  const Moment moment = At(time_s);
  const RenderedView view = RenderMoment(moment, truth_[index].world_from_cam);
  cv::Mat3f light = view.image;
  if (samples > 1) {
    light = cv::Mat3f::zeros(view.image.size());
    for (int i = 0; i < samples; ++i) {
      const double at_s = time_s + exposure_s * ((i + 0.5) / samples - 0.5);
      // An odd number has the middle among them.
      const cv::Mat3f part = 2 * i + 1 == samples ? view.image : Render(at_s, motion_.At(at_s)).image;
      cv::scaleAdd(part, 1.0 / samples, light, light);
    }
  }
  SimulatedFrame frame;
  frame.image = DevelopImage(
      options_.effects, SubSeed(SubSeed(options_.seed, kNoise), static_cast<uint64_t>(index)), time_s, light);
  frame.objects = view.objects;
  frame.depth_m = view.depth_m;
  frame.moving.create(view.objects.size());
  for (int row = 0; row < frame.moving.rows; ++row) {
    const int* object = view.objects.ptr<int>(row);
    uint8_t* moving = frame.moving.ptr<uint8_t>(row);
    for (int column = 0; column < frame.moving.cols; ++column) {
      moving[column] = object[column] != kNoObject && world_.objects[object[column]].moves ? 255 : 0;
    }
  }
  frame.boxes = Boxes(moment, view, truth_[index].world_from_cam);
  return frame;
}

std::vector<TrueBox> Simulation::Boxes(const Moment& moment, const RenderedView& view,
                                       const Rigid3& world_from_cam) const {
  struct Extent {
    int pixels = 0, left = 1 << 20, top = 1 << 20, right = -1, bottom = -1;
  };
  std::vector<Extent> extents(world_.objects.size());
  for (int row = 0; row < view.objects.rows; ++row) {
    const int* objects = view.objects.ptr<int>(row);
    for (int column = 0; column < view.objects.cols; ++column) {
      if (objects[column] == kNoObject) continue;
      Extent& e = extents[objects[column]];
      ++e.pixels;
      e.left = std::min(e.left, column);
      e.right = std::max(e.right, column);
      e.top = std::min(e.top, row);
      e.bottom = std::max(e.bottom, row);
    }
  }
  std::vector<TrueBox> boxes;
  constexpr int kMinPixels = 16;
  for (size_t i = 0; i < extents.size(); ++i) {
    const Extent& e = extents[i];
    if (e.pixels < kMinPixels) continue;
    const Box box{e.left + 0.0, e.top + 0.0, e.right - e.left + 1.0, e.bottom - e.top + 1.0};
    const int object = static_cast<int>(i);
    boxes.push_back({object, box, renderer_.VisibleShare(moment.all, object, view, world_from_cam)});
  }
  return boxes;
}

SceneOptions LoadScene(const std::string& name_or_path) {
  SceneOptions options;
  LoadOptions(FindConfig("scenes", "scene", name_or_path, std::vector<std::string>{"room"}), &options);
  return options;
}

std::vector<std::string> KnownScenes() { return ConfigNames("scenes"); }

std::unique_ptr<FrameSource> MakeSimulationSource(const Simulation& simulation) {
  return std::make_unique<SimulationSource>(simulation);
}

}  // namespace dynamic_slam
