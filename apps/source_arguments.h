#pragma once

#include <CLI/CLI.hpp>

#include "dynamic_slam/io/frame_source.h"

namespace dynamic_slam {

// The options that say which part of a source is read, the same for every command that reads one.
inline void AddSourceOptions(CLI::App* command, FrameSourceOptions* options) {
  command->add_option("--start", options->start, "Frames to skip first")->check(CLI::NonNegativeNumber);
  command->add_option("--max-frames", options->max_frames, "Frames to read at most (0: all)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--fps", options->fps, "Frames a second of a folder of images (30) or a video")
      ->check(CLI::NonNegativeNumber);
}

}  // namespace dynamic_slam
