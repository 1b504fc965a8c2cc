#include "arrays.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace py = pybind11;

namespace dynamic_slam {
namespace {

py::array Require(const py::object& object, const std::string& name) {
  if (!py::isinstance<py::array>(object)) {
    throw py::type_error(name + " must be a numpy array, not " +
                         py::str(py::type::of(object).attr("__name__")).cast<std::string>());
  }
  return py::reinterpret_borrow<py::array>(object);
}

std::string DtypeText(const py::array& array) { return py::str(array.dtype()).cast<std::string>(); }

// With rows one after the other and no gaps, as cv::Mat has them.
template <class T>
cv::Mat Copy(const py::array& array, int depth) {
  const auto dense = py::array_t<T, py::array::c_style>::ensure(array);
  if (!dense) throw py::error_already_set();
  const int channels = dense.ndim() == 3 ? static_cast<int>(dense.shape(2)) : 1;
  cv::Mat image(static_cast<int>(dense.shape(0)), static_cast<int>(dense.shape(1)),
                CV_MAKETYPE(depth, channels));
  std::memcpy(image.data, dense.data(), static_cast<size_t>(dense.nbytes()));
  return image;
}

std::string SizeText(int width, int height, const char* more = "") {
  return "(" + std::to_string(height) + ", " + std::to_string(width) + more + ")";
}

std::string ShapeText(const py::array& array) { return py::str(array.attr("shape")).cast<std::string>(); }

}  // namespace

cv::Mat ToImage(const py::object& object, int width, int height) {
  const py::array array = Require(object, "image");
  const bool is_8 = py::isinstance<py::array_t<uint8_t>>(array);
  if (!is_8 && !py::isinstance<py::array_t<uint16_t>>(array)) {
    throw py::type_error("image must have dtype uint8 or uint16, not " + DtypeText(array));
  }
  const bool has_channels = array.ndim() == 3 && (array.shape(2) == 3 || array.shape(2) == 4);
  if ((array.ndim() != 2 && !has_channels) || array.shape(0) != height || array.shape(1) != width) {
    throw py::value_error("image must have shape " + SizeText(width, height) + ", " +
                          SizeText(width, height, ", 3") + " or " + SizeText(width, height, ", 4") +
                          ", the camera's size, not " + ShapeText(array));
  }
  return is_8 ? Copy<uint8_t>(array, CV_8U) : Copy<uint16_t>(array, CV_16U);
}

cv::Mat ToMask(const py::object& object, int width, int height) {
  const py::array array = Require(object, "mask");
  if (!py::isinstance<py::array_t<uint8_t>>(array) && !py::isinstance<py::array_t<bool>>(array)) {
    throw py::type_error("mask must have dtype uint8 or bool, not " + DtypeText(array));
  }
  if (array.ndim() != 2 || array.shape(0) != height || array.shape(1) != width) {
    throw py::value_error("mask must have shape " + SizeText(width, height) +
                          ", the size of the prepared images, not " + ShapeText(array));
  }
  return Copy<uint8_t>(array, CV_8U);
}

py::array ToArray(const cv::Mat& image) {
  std::vector<py::ssize_t> shape = {image.rows, image.cols};
  if (image.channels() > 1) shape.push_back(image.channels());
  const cv::Mat dense = image.isContinuous() ? image : image.clone();
  return py::array(dense.depth() == CV_16U ? py::dtype::of<uint16_t>() : py::dtype::of<uint8_t>(), shape,
                   dense.data);
}

py::array_t<double> ToArray(const Trajectory& trajectory) {
  py::array_t<double> array({static_cast<py::ssize_t>(trajectory.size()), py::ssize_t{8}});
  auto rows = array.mutable_unchecked<2>();
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const StampedPose& pose = trajectory[static_cast<size_t>(i)];
    const Eigen::Vector3d& t = pose.world_from_cam.translation;
    const Eigen::Vector4d q = pose.world_from_cam.rotation.coeffs();  // x y z w
    rows(i, 0) = pose.timestamp_s;
    for (int k = 0; k < 3; ++k) rows(i, 1 + k) = t[k];
    for (int k = 0; k < 4; ++k) rows(i, 4 + k) = q[k];
  }
  return array;
}

Trajectory ToTrajectory(const py::object& object, const std::string& name) {
  const py::array given = Require(object, name);
  if (given.dtype().kind() != 'f' && given.dtype().kind() != 'i') {
    throw py::type_error(name + " must have a dtype of numbers, not " + DtypeText(given));
  }
  if (given.ndim() != 2 || given.shape(1) != 8) {
    throw py::value_error(name + " must have shape (n, 8), rows of timestamp x y z qx qy qz qw, not " +
                          ShapeText(given));
  }
  const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(given);
  if (!array) throw py::error_already_set();
  const auto rows = array.unchecked<2>();
  Trajectory trajectory(static_cast<size_t>(rows.shape(0)));
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const auto fail = [&](const std::string& reason) {
      throw py::value_error(name + ", row " + std::to_string(i) + ": " + reason);
    };
    for (int k = 0; k < 8; ++k) {
      if (!std::isfinite(rows(i, k))) fail("not all numbers are finite");
    }
    if (i > 0 && rows(i, 0) < rows(i - 1, 0)) fail("its timestamp goes back");
    Eigen::Quaterniond rotation(rows(i, 7), rows(i, 4), rows(i, 5), rows(i, 6));
    const double norm = rotation.norm();
    if (std::abs(norm - 1) > 0.01) fail("its quaternion's norm is " + std::to_string(norm) + ", not 1");
    if (std::abs(norm - 1) > 1e-9) rotation.normalize();  // else the same bytes come back
    StampedPose& pose = trajectory[static_cast<size_t>(i)];
    pose.timestamp_s = rows(i, 0);
    pose.world_from_cam.rotation = rotation;
    pose.world_from_cam.translation = {rows(i, 1), rows(i, 2), rows(i, 3)};
  }
  return trajectory;
}

py::array_t<double> ToArray(const Rigid3& target_from_source) {
  py::array_t<double> array({4, 4});
  auto rows = array.mutable_unchecked<2>();
  const Eigen::Matrix3d R = target_from_source.Matrix();
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 3; ++column) rows(row, column) = row < 3 ? R(row, column) : 0;
    rows(row, 3) = row < 3 ? target_from_source.translation[row] : 1;
  }
  return array;
}

}  // namespace dynamic_slam
