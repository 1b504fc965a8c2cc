#pragma once

#include <string>

#include <opencv2/core/mat.hpp>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "dynamic_slam/dynamic_slam.h"

namespace dynamic_slam {

// Between numpy's arrays and our values. Each throws TypeError for what is no array or of another dtype, and
// ValueError that names the wanted and the given shape.

// A copy of an image of uint8 or uint16, of shape (height, width) or (height, width, 3 or 4).
cv::Mat ToImage(const pybind11::object& array, int width, int height);

// A copy of a mask of uint8 or bool, of shape (height, width).
cv::Mat ToMask(const pybind11::object& array, int width, int height);

pybind11::array ToArray(const cv::Mat& image);

// (n, 8): timestamp, position x y z, quaternion x y z w.
pybind11::array_t<double> ToArray(const Trajectory& trajectory);
Trajectory ToTrajectory(const pybind11::object& array, const std::string& name);

// (4, 4).
pybind11::array_t<double> ToArray(const Rigid3& target_from_source);

}  // namespace dynamic_slam
