#include "cmd_simulate.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/sim/room.h"
#include "dynamic_slam/sim/simulation.h"
#include "render_sequence.h"

namespace dynamic_slam {
namespace {

struct SimulateArguments {
  std::string scene, camera, out;
  std::vector<std::string> settings;
  std::optional<uint64_t> seed;
  std::optional<int> frames;
  std::optional<double> noise_grey;
  bool depth = false, force = false;
};

// The static room of the tests and the demo; it has no scene file.
void SimulateRoom(const SimulateArguments& arguments) {
  if (!arguments.settings.empty() || arguments.depth) {
    throw InputError("room", "has no --set and no --depth",
                     fmt::format("Scenes have: {}.", fmt::join(KnownScenes(), ", ")));
  }
  RoomOptions options;
  options.seed = arguments.seed.value_or(options.seed);
  options.frames = arguments.frames.value_or(options.frames);
  options.noise_grey = arguments.noise_grey.value_or(options.noise_grey);
  if (!arguments.camera.empty()) options.camera = LoadCamera(arguments.camera);
  if (!arguments.force) CheckHoldsNoSequence(arguments.out);
  RenderRoom(Room(options), arguments.out);
}

void RunSimulate(const SimulateArguments& arguments) {
  if (arguments.scene == "room") return SimulateRoom(arguments);
  SceneOptions options = LoadScene(arguments.scene);
  ApplySet(&options, arguments.settings);
  options.seed = arguments.seed.value_or(options.seed);
  options.frames = arguments.frames.value_or(options.frames);
  options.effects.noise_grey = arguments.noise_grey.value_or(options.effects.noise_grey);
  if (!arguments.camera.empty()) options.camera.model = arguments.camera;
  if (!arguments.force) CheckHoldsNoSequence(arguments.out);
  RenderScene(options, arguments.out, arguments.depth);
}

}  // namespace

void AddSimulateCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("simulate", "Render a sequence with exact ground truth, in TUM RGB-D layout");
  const auto arguments = std::make_shared<SimulateArguments>();
  SimulateArguments& a = *arguments;
  command
      ->add_option("SCENE", a.scene,
                   fmt::format("A scene file, or the name of one: {}; or room, a static one",
                               fmt::join(KnownScenes(), ", ")))
      ->required();
  command
      ->add_option("--out", a.out,
                   "Folder for rgb/, rgb.txt, groundtruth.txt, camera.yaml, boxes.csv, masks/")
      ->required();
  command->add_option("--seed", a.seed, "The same seed gives the same bytes; default: the scene's");
  command->add_option("--frames", a.frames, "Number of frames; default: the scene's")
      ->check(CLI::Range(1, 1000000));
  command->add_option("--camera", a.camera, "Name or file of a camera; default: the scene's");
  command->add_option("--noise", a.noise_grey, "Standard deviation of the pixel noise, grey levels")
      ->check(CLI::Range(0.0, 50.0));
  command
      ->add_option("--set", a.settings,
                   "One option of the scene file, such as people.count=4; may be repeated")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);  // else it takes SCENE
  command->add_flag("--depth", a.depth, "Write depth images too");
  command->add_flag("--force", a.force, "Replace a sequence that is in --out");
  command->footer(
      "Examples:\n  dynamic_slam simulate office --seed 3 --out office3\n"
      "  dynamic_slam simulate office --set camera.motion=xyz --set people.count=0 --out still");
  command->callback([arguments] { RunSimulate(*arguments); });
}

}  // namespace dynamic_slam
