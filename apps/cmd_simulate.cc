#include "cmd_simulate.h"

#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/sim/room.h"
#include "render_room.h"

namespace dynamic_slam {
namespace {

struct SimulateArguments {
  std::string world, camera, out;
  RoomOptions room;
  bool force = false;
};

void RunSimulate(const SimulateArguments& arguments) {
  RoomOptions options = arguments.room;
  if (!arguments.camera.empty()) options.camera = LoadCamera(arguments.camera);
  if (!arguments.force) CheckHoldsNoSequence(arguments.out);
  RenderRoom(Room(options), arguments.out);
}

}  // namespace

void AddSimulateCommand(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("simulate", "Render a sequence with exact ground truth, in TUM RGB-D layout");
  const auto arguments = std::make_shared<SimulateArguments>();
  SimulateArguments& a = *arguments;
  command->add_option("WORLD", a.world, "room: a textured room, filmed by a hand-held camera")
      ->required()
      ->check(CLI::IsMember({"room"}));
  command->add_option("--out", a.out, "Folder for rgb/, rgb.txt, groundtruth.txt, camera.yaml")->required();
  command->add_option("--seed", a.room.seed, "The same seed gives the same bytes")->capture_default_str();
  command->add_option("--frames", a.room.frames, "Number of frames")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command->add_option("--camera", a.camera,
                      "Name or file of a camera; default: 640x480, 30 fps, no distortion");
  command->add_option("--noise", a.room.noise_grey, "Standard deviation of the pixel noise, grey levels")
      ->check(CLI::Range(0.0, 50.0))
      ->capture_default_str();
  command->add_flag("--force", a.force, "Replace a sequence that is in --out");
  command->footer("Example:\n  dynamic_slam simulate room --seed 3 --frames 300 --out room3");
  command->callback([arguments] { RunSimulate(*arguments); });
}

}  // namespace dynamic_slam
