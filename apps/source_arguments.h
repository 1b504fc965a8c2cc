#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "dynamic_slam/io/frame_source.h"
#include "dynamic_slam/system/system_options.h"

namespace dynamic_slam {

// The options that say which part of a source is read, the same for every command that reads one.
inline void AddSourceOptions(CLI::App* command, FrameSourceOptions* options) {
  command->add_option("--start", options->start, "Frames to skip first")->check(CLI::NonNegativeNumber);
  command->add_option("--max-frames", options->max_frames, "Frames to read at most (0: all)")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--fps", options->fps, "Frames a second of a folder of images (30) or a video")
      ->check(CLI::NonNegativeNumber);
}

// The camera of a name or file, or, when that is empty, the one that the source describes itself. Throws
// InputError when there is none, or it does not fit the images.
Camera ChooseCamera(const std::string& name_or_file, const std::string& source_name,
                    const FrameSource& source);

// Options from a file, or of a profile in config/profiles, by its name. Throws InputError.
void LoadProfile(const std::string& name_or_file, SystemOptions* options);

// "fast, g3, ...".
std::string ProfileHelp();

}  // namespace dynamic_slam
