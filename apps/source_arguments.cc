#include "source_arguments.h"

#include <optional>

#include <fmt/format.h>

#include "dynamic_slam/base/config_files.h"
#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/options.h"
#include "dynamic_slam/io/camera_file.h"

namespace dynamic_slam {

Camera ChooseCamera(const std::string& name_or_file, const std::string& source_name,
                    const FrameSource& source) {
  Camera camera;
  if (!name_or_file.empty()) {
    camera = LoadCamera(name_or_file);
  } else if (const std::optional<Camera> own = source.OwnCamera(); own.has_value()) {
    camera = *own;
  } else {
    std::string known;
    for (const std::string& name : KnownCameras()) known += (known.empty() ? "" : ", ") + name;
    throw InputError(source_name, "has no camera file of its own",
                     fmt::format("Give one with --camera FILE, or --camera NAME with one of: {}.", known));
  }
  CheckCameraFits(camera, name_or_file.empty() ? source_name : name_or_file, source.ImageSize());
  return camera;
}

void LoadProfile(const std::string& name_or_file, SystemOptions* options) {
  LoadOptions(FindConfig("profiles", "options", name_or_file), options);
}

std::string ProfileHelp() { return fmt::format("{}", fmt::join(ConfigNames("profiles"), ", ")); }

}  // namespace dynamic_slam
