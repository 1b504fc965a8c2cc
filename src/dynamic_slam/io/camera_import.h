#pragma once

#include <filesystem>
#include <optional>

#include <opencv2/core/types.hpp>

#include "dynamic_slam/geometry/camera.h"
#include "dynamic_slam/io/flat_yaml.h"

namespace dynamic_slam {

// Reads the calibration file of another program, recognised by its keys:
//
// | program | keys | lenses |
// |---|---|---|
// | ORB-SLAM2, ORB-SLAM3 | `Camera.fx` or `Camera1.fx`, `Camera.type` | PinHole, KannalaBrandt8, Rectified |
// | OpenVSLAM, stella_vslam | `Camera.model`, flat or nested | perspective, fisheye |
// | Kalibr's camera chain | `cam0:` with `camera_model` | pinhole with radtan, equidistant, none |
// | EuRoC's sensor.yaml | the same without `cam0:` | the same |
//
// Of several cameras the first is taken: Camera1, cam0. image_size: for files that hold none, as many of
// ORB-SLAM2; it must agree with that of a file that does. The camera is named after the file, unless that
// names it, and is validated. Throws InputError with file:line for each problem: other models, missing keys,
// what is no finite number.
Camera ImportCamera(const std::filesystem::path& file,
                    const std::optional<cv::Size>& image_size = std::nullopt);

// Whether the keys are those of a file that ImportCamera reads.
bool IsForeignCalibration(const FlatYaml& yaml);

// P0 of a KITTI calib.txt; that file holds neither size nor frame rate.
Camera ReadKittiCalibration(const std::filesystem::path& file, const cv::Size& image_size, double fps);

}  // namespace dynamic_slam
