#include "cmd_map.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/io/colmap_model.h"
#include "dynamic_slam/io/point_cloud_file.h"
#include "dynamic_slam/io/trajectory_file.h"
#include "dynamic_slam/map/map_file.h"

namespace dynamic_slam {
namespace {

struct MapArguments {
  std::string file, out;
  int part = 0;
};

struct PartContents {
  PartId id;
  std::vector<const Keyframe*> keyframes;  // by stamp
  std::vector<const Landmark*> landmarks;
};

// The parts of the map, the one with the most keyframes first.
std::vector<PartContents> ContentsOf(const Map& map) {
  std::vector<PartContents> parts;
  for (const PartId id : map.Parts()) {
    PartContents part{id, {}, {}};
    map.keyframes().ForEach([&](const Keyframe& keyframe) {
      if (keyframe.part() == id) part.keyframes.push_back(&keyframe);
    });
    map.landmarks().ForEach([&](const Landmark& landmark) {
      if (map.PartOf(landmark) == id) part.landmarks.push_back(&landmark);
    });
    std::stable_sort(part.keyframes.begin(), part.keyframes.end(), [](const Keyframe* a, const Keyframe* b) {
      return a->timestamp_s() < b->timestamp_s();
    });
    parts.push_back(std::move(part));
  }
  std::stable_sort(parts.begin(), parts.end(), [](const PartContents& a, const PartContents& b) {
    return a.keyframes.size() > b.keyframes.size();
  });
  return parts;
}

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
  const std::vector<PartContents> parts = ContentsOf(saved.map);
  for (size_t i = 0; i < parts.size(); ++i) {
    fmt::print("part {}     {} keyframes from {:.6f} to {:.6f} s, {} landmarks\n", i + 1,
               parts[i].keyframes.size(), parts[i].keyframes.front()->timestamp_s(),
               parts[i].keyframes.back()->timestamp_s(), parts[i].landmarks.size());
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
  const SavedMap saved = ReadMapFile(arguments.file);
  const std::vector<PartContents> parts = ContentsOf(saved.map);
  if (static_cast<size_t>(arguments.part) > parts.size()) {
    throw InputError(arguments.file,
                     fmt::format("has {} parts, and no part {}", parts.size(), arguments.part),
                     "See `dynamic_slam map info`.");
  }
  const PartContents& part = parts[static_cast<size_t>(arguments.part - 1)];
  const std::filesystem::path out(arguments.out);
  std::vector<Eigen::Vector3f> points;
  for (const Landmark* landmark : part.landmarks) points.push_back(landmark->position().cast<float>());
  WritePly(out / "map.ply", points);
  Trajectory keyframes;
  for (const Keyframe* keyframe : part.keyframes) {
    keyframes.push_back({keyframe->timestamp_s(), keyframe->cam_from_world().Inverse()});
  }
  WriteTumTrajectory(out / "keyframes.txt", keyframes);
  WriteColmapModel(out / "colmap", saved.camera, saved.map, part.id);
  fmt::print("{} keyframes and {} landmarks: {}/map.ply, keyframes.txt and colmap\n", part.keyframes.size(),
             part.landmarks.size(), out.string());
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
