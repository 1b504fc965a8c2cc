#include "cmd_map.h"

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "dynamic_slam/api/map_contents.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/map/map_file.h"
#include "dynamic_slam/map_view.h"

namespace dynamic_slam {
namespace {

struct MapArguments {
  std::string file, out;
  int part = 0;
};

void PrintInfo(const MapArguments& arguments) {
  const SavedMap saved = ReadMapFile(arguments.file);
  const Camera& camera = saved.camera;
  fmt::print("map file   version {}, {} bytes\n", kMapFileVersion,
             std::filesystem::file_size(arguments.file));
  fmt::print("camera     {}, {} x {} px, fx {:.2f} fy {:.2f} cx {:.2f} cy {:.2f}\n",
             camera.name.empty() ? "without a name" : camera.name, camera.width, camera.height, camera.fx,
             camera.fy, camera.cx, camera.cy);
  fmt::print("octaves    {}\n", saved.map.octave_scales().size());
  fmt::print("keyframes  {}\nlandmarks  {}\n", saved.map.keyframes().size(), saved.map.landmarks().size());
  int number = 0;
  for (const MapView::Part& part : ContentsOf(camera, saved.map).parts) {
    fmt::print("part {}     {} keyframes from {:.6f} to {:.6f} s, {} landmarks\n", ++number,
               part.keyframes.size(), part.keyframes.front().timestamp_s, part.keyframes.back().timestamp_s,
               part.landmarks.size());
  }
}

void Validate(const MapArguments& arguments) {
  const SavedMap saved = ReadMapFile(arguments.file);
  const std::vector<std::string> problems = saved.map.Validate();
  // The reader refuses what is not valid, so these are ours.
  DS_CHECK(problems.empty(), "{}: {}", arguments.file, problems.front());
  fmt::print("{}: valid, {} keyframes, {} landmarks\n", arguments.file, saved.map.keyframes().size(),
             saved.map.landmarks().size());
}

void Export(const MapArguments& arguments) {
  const MapView::Part part = ExportMap(arguments.file, arguments.out, arguments.part);
  fmt::print("{} keyframes and {} landmarks: {}/map.ply, keyframes.txt and colmap\n", part.keyframes.size(),
             part.landmarks.size(), arguments.out);
}

}  // namespace

void AddMapCommand(CLI::App& app) {
  CLI::App* command = app.add_subcommand("map", "Look at maps that run --save-map wrote, and export them");
  command->require_subcommand(1);
  const auto arguments = std::make_shared<MapArguments>();
  const auto add = [&](const std::string& name, const std::string& what, void (*run)(const MapArguments&)) {
    CLI::App* sub = command->add_subcommand(name, what);
    sub->add_option("FILE", arguments->file, "Map file")->required();
    sub->callback([arguments, run] { run(*arguments); });
    return sub;
  };
  add("info", "Say what is in the map", PrintInfo);
  add("validate", "Check the file and the map in it", Validate);
  CLI::App* sub = add("export", "Write map.ply, keyframes.txt (TUM) and colmap/, a text model", Export);
  sub->add_option("--out", arguments->out, "Folder for the files")->required();
  sub->add_option("--part", arguments->part, "Of the map, as `info` counts them")
      ->default_val(1)
      ->check(CLI::PositiveNumber);
  command->footer("Example:\n  dynamic_slam map export office.map --out office");
}

}  // namespace dynamic_slam
