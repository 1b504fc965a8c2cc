// `dynamic_slam run` on a bag: offline, every image, without a roscore.

#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "bag_source.h"
#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/io/detector_factory.h"
#include "dynamic_slam/system/sequence_runner.h"
#include "program.h"

namespace dynamic_slam {
namespace {

constexpr int kExitInterrupted = 130;

volatile std::sig_atomic_t interrupted = 0;

struct Arguments {
  std::string bag, out, topic, camera_topic, camera, config, detector = "none", models;
  std::vector<std::string> assignments;
};

Camera ChooseCamera(const Arguments& arguments, const FrameSource& source) {
  if (arguments.camera.empty()) {
    if (const std::optional<Camera> own = source.OwnCamera()) {
      CheckCameraFits(*own, arguments.bag, source.ImageSize());
      return *own;
    }
    throw InputError(arguments.bag, "has no sensor_msgs/CameraInfo", "Give a camera file with --camera.");
  }
  const Camera camera = LoadCamera(arguments.camera);
  CheckCameraFits(camera, arguments.camera, source.ImageSize());
  return camera;
}

int Run(const Arguments& arguments) {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { interrupted = 1; });
  SystemOptions options;
  if (!arguments.config.empty()) LoadOptions(FindConfig("profiles", "options", arguments.config), &options);
  ApplySet(&options, arguments.assignments);
  const std::unique_ptr<FrameSource> source = OpenBag(arguments.bag, arguments.topic, arguments.camera_topic);
  SlamSystem system(ChooseCamera(arguments, *source), options);
  system.SetDetector(MakeDetector(arguments.detector, arguments.models));
  const std::filesystem::path out =
      arguments.out.empty() ? std::filesystem::path("out") / std::filesystem::path(arguments.bag).stem()
                            : std::filesystem::path(arguments.out);
  PrepareOutputFolder(out);
  RunControl control;
  control.should_stop = [] { return interrupted != 0; };
  RunSummary summary = RunSequence(*source, system, control);
  summary.source = arguments.bag;
  // Whatever ended the run, what it has so far is kept.
  if (!summary.frames.empty()) WriteResults(out, system, summary);
  if (summary.failure != nullptr) std::rethrow_exception(summary.failure);
  fmt::print("{} of {} images have a pose\nresults: {}\n", system.FrameTrajectory().size(),
             summary.frames_total, out.string());
  return summary.interrupted ? kExitInterrupted : 0;
}

}  // namespace
}  // namespace dynamic_slam

int main(int argc, char** argv) {
  CLI::App app("The camera's path through a bag, and a map: offline, every image, without a roscore",
               "bag_runner");
  dynamic_slam::Arguments a;
  app.add_option("BAG", a.bag, "Bag with images")->required();
  app.add_option("--topic", a.topic, "Topic of the images (default: the only one)");
  app.add_option("--camera-topic", a.camera_topic, "Topic of the calibration (default: the only one)");
  app.add_option("--camera", a.camera, "Name of a known camera, or camera file, instead of the calibration");
  app.add_option("--config", a.config, "YAML file with options, or a profile");
  app.add_option("--set", a.assignments, "One option, key=value; may be repeated")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);  // else it takes BAG
  app.add_option("--detector", a.detector, "Object detector: " + dynamic_slam::DetectorHelp())
      ->capture_default_str();
  app.add_option("--models", a.models, "Folder in which network files are looked for too");
  app.add_option("--out", a.out, "Folder for the results (default: out/ and the name of the bag)");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return dynamic_slam::RunProgram([&a] { return Run(a); });
}
