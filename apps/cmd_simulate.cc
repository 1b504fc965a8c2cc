#include "cmd_simulate.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <unistd.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/camera_file.h"
#include "dynamic_slam/sim/room.h"
#include "dynamic_slam/sim/sequence_writer.h"

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
  const std::filesystem::path folder = arguments.out;
  if (!arguments.force && std::filesystem::exists(folder / "rgb.txt")) {
    throw InputError(folder.string(), "holds a sequence already",
                     "Give another --out, or --force to replace it.");
  }
  const Room room(options);
  const bool terminal = isatty(fileno(stderr)) != 0;
  WriteTumSequence(room, folder, [&](int frames) {
    if (terminal) fmt::print(stderr, "\rrendered {} of {} frames", frames, options.frames);
  });
  if (terminal) fmt::print(stderr, "\n");
  double path_m = 0;
  const Trajectory& truth = room.truth();
  for (size_t i = 1; i < truth.size(); ++i) {
    path_m += (truth[i].world_from_cam.translation - truth[i - 1].world_from_cam.translation).norm();
  }
  fmt::print("{}: {} frames, path {:.2f} m, seed {}\n", folder.string(), options.frames, path_m,
             options.seed);
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
