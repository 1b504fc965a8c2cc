#pragma once

#include <memory>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/geometry/trajectory.h"
#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/semantics/detection.h"
#include "dynamic_slam/sim/actors.h"
#include "dynamic_slam/sim/camera_motion.h"
#include "dynamic_slam/sim/scene_options.h"

namespace dynamic_slam {

// The true box of an object in an image: around the pixels that show it.
struct TrueBox {
  int actor = 0;       // index in World::objects
  Box box;             // px
  double visible = 1;  // share of the whole silhouette, inside the image and beyond, that is seen
};

// A frame with all that is true of it. At the frame's stamp, which is the middle of its exposure.
struct SimulatedFrame {
  cv::Mat image;               // CV_8UC3, as the camera delivers it
  cv::Mat1b moving;            // 255 where something that moves is seen, else 0
  cv::Mat1i objects;           // index in World::objects, or kNoObject
  cv::Mat1f depth_m;           // along the optical axis; 0: sky
  std::vector<TrueBox> boxes;  // of all objects with 16 pixels or more, by actor
};

// A scene in motion: any frame at any time, from any thread. The same options give the same bytes.
class Simulation {
 public:
  // Throws InputError for options out of range or a camera that does not exist.
  explicit Simulation(const SceneOptions& options);

  const SceneOptions& options() const { return options_; }
  const Camera& camera() const { return renderer_.camera(); }
  const World& world() const { return world_; }
  // world_from_cam of each frame, exact; stamps are frame / fps, s.
  const Trajectory& truth() const { return truth_; }
  // Whether the camera loses this frame.
  bool IsDropped(int index) const;

  SimulatedFrame Frame(int index) const;

  // Puts one more thing that stands still into the world.
  void Add(const MeshInstance& instance) { world_.statics.push_back(instance); }

  // What a camera would see at the time (s): without blur, noise and the like.
  RenderedView Render(double time_s, const Rigid3& world_from_cam) const;

 private:
  struct Moment;
  Moment At(double time_s) const;
  RenderedView RenderMoment(const Moment& moment, const Rigid3& world_from_cam) const;
  int ExposureSamples(int index) const;
  std::vector<TrueBox> Boxes(const Moment& moment, const RenderedView& view,
                             const Rigid3& world_from_cam) const;

  SceneOptions options_;
  World world_;
  std::vector<std::unique_ptr<Actor>> actors_;
  MeshRenderer renderer_;
  CameraMotion motion_;
  Trajectory truth_;
};

// A scene file by name (config/scenes) or path. Throws InputError with file:line for each problem.
SceneOptions LoadScene(const std::string& name_or_path);
std::vector<std::string> KnownScenes();

// The frames of a simulation in memory. It must outlive the source.
std::unique_ptr<FrameSource> MakeSimulationSource(const Simulation& simulation);

}  // namespace dynamic_slam
