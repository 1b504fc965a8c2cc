#pragma once

#include <string>
#include <vector>

#include "dynamic_slam/system/run_mode.h"

namespace dynamic_slam {

// What a System is asked for, in the words of `dynamic_slam run`.
struct Options {
  std::string config;            // YAML file with options, or the name of a profile; "": the defaults
  std::vector<std::string> set;  // "key=value" for single ones, after those of `config` (docs/config.md)
  RunMode mode = RunMode::kOffline;
  std::string detector = "none";  // "none", "hog", "boxes:FILE.csv", a detector file or the name of one
  std::string models;             // folder in which network files are looked for too, or ""
  std::string map;             // file of an earlier run's map, in which the camera is looked for first, or ""
  bool localise_only = false;  // only poses in that map, which stays as it is
};

}  // namespace dynamic_slam
