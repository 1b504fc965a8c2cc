#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <opencv2/core/types.hpp>

#include "dynamic_slam/base/export.h"
#include "dynamic_slam/geometry/camera.h"

namespace dynamic_slam {

// Reads a camera file (YAML): model, width, height, fx, fy, cx, cy, and optionally name and fps. The model is
// pinhole, with k1, k2, p1, p2, k3 where the lens distorts, or kannala_brandt, with k1, k2, k3, k4. The
// camera is validated. Throws InputError with file:line for each problem.
DYNAMIC_SLAM_API Camera ReadCamera(const std::filesystem::path& file);

// `name_or_path` is a camera file, or the name of one of config/cameras (base/config_files.h). An InputError
// for an unknown name lists the known ones.
DYNAMIC_SLAM_API Camera LoadCamera(const std::string& name_or_path);

// The names that LoadCamera knows, sorted.
DYNAMIC_SLAM_API std::vector<std::string> KnownCameras();

// A camera without distortion gets that of a known one, of this family of names, that is the same but for it:
// calibrations of rectified images, as KITTI's, say nothing of what is left of the lens.
Camera WithKnownLens(const Camera& camera, std::string_view family);

// As ReadCamera reads it.
DYNAMIC_SLAM_API std::string CameraToYaml(const Camera& camera);
DYNAMIC_SLAM_API void WriteCamera(const std::filesystem::path& file, const Camera& camera);

// Throws InputError when images of this size cannot be from that camera. origin: where the camera is from,
// for the message.
void CheckCameraFits(const Camera& camera, const std::string& origin, const cv::Size& image_size);

}  // namespace dynamic_slam
