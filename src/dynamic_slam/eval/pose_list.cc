#include "dynamic_slam/eval/pose_list.h"

#include <charconv>
#include <cmath>
#include <fstream>
#include <string_view>

#include <Eigen/Geometry>

#include "dynamic_slam/base/error.h"

namespace dynamic_slam {
namespace {

struct Row {
  int line = 0;
  std::vector<double> values;
};

constexpr std::string_view kBlank = " \t\r";

// Every line that is neither empty nor a comment, as exactly `columns` finite numbers.
std::vector<Row> ReadRows(const std::string& path, size_t columns, const std::string& layout) {
  std::ifstream file(path);
  if (!file) throw InputError(path, "cannot be opened", "Check the path and that the file may be read.");
  std::vector<Row> rows;
  std::string text;
  for (int line = 1; std::getline(file, text); ++line) {
    std::string_view rest(text);
    Row row{line, {}};
    while (true) {
      const size_t start = rest.find_first_not_of(kBlank);
      if (start == std::string_view::npos || rest[start] == '#') break;
      rest.remove_prefix(start);
      const std::string_view word = rest.substr(0, rest.find_first_of(kBlank));
      const std::string_view number = word.substr(word.front() == '+' ? 1 : 0);
      double value = 0;
      const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), value);
      if (error != std::errc() || end != number.data() + number.size() || !std::isfinite(value)) {
        throw InputError(fmt::format("{}:{}", path, line), fmt::format("'{}' is not a finite number", word),
                         "Expected " + layout + ".");
      }
      row.values.push_back(value);
      rest.remove_prefix(word.size());
    }
    if (row.values.empty()) continue;
    if (row.values.size() != columns) {
      throw InputError(fmt::format("{}:{}", path, line),
                       fmt::format("{} numbers, expected {}", row.values.size(), columns),
                       "Expected " + layout + ".");
    }
    rows.push_back(std::move(row));
  }
  if (rows.empty()) throw InputError(path, "holds no data", "Expected " + layout + ".");
  return rows;
}

}  // namespace

PoseList ToPoseList(const Trajectory& trajectory) {
  PoseList poses;
  poses.reserve(trajectory.size());
  for (const StampedPose& pose : trajectory) {
    poses.push_back({pose.timestamp_s, pose.world_from_cam.Matrix(), pose.world_from_cam.translation});
  }
  return poses;
}

PoseList ReadTumPoses(const std::string& path) {
  PoseList poses;
  for (const auto& [line, v] : ReadRows(path, 8, "TUM lines: timestamp tx ty tz qx qy qz qw")) {
    const std::string place = fmt::format("{}:{}", path, line);
    const Eigen::Quaterniond rotation(v[7], v[4], v[5], v[6]);
    if (rotation.norm() < 1e-6) throw InputError(place, "the quaternion is zero", "Remove the line.");
    if (!poses.empty() && v[0] < poses.back().timestamp_s) {
      throw InputError(place, fmt::format("stamp {} comes after {}", v[0], poses.back().timestamp_s),
                       "Sort the file by time.");
    }
    poses.push_back({v[0], rotation.normalized().toRotationMatrix(), Eigen::Vector3d(v[1], v[2], v[3])});
  }
  return poses;
}

PoseList ReadKittiPoses(const std::string& path, const std::string& times_path) {
  PoseList poses;
  for (const auto& [line, v] : ReadRows(path, 12, "KITTI lines: the 3x4 matrix of a pose, row by row")) {
    const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(v.data());
    if (std::abs(matrix.leftCols<3>().determinant() - 1.0) > 0.01) {
      throw InputError(fmt::format("{}:{}", path, line), "the left 3x3 part is not a rotation",
                       "Expected KITTI lines: the 3x4 matrix of a pose, row by row.");
    }
    poses.push_back({static_cast<double>(poses.size()), matrix.leftCols<3>(), matrix.col(3)});
  }
  if (times_path.empty()) return poses;
  const std::vector<Row> times = ReadRows(times_path, 1, "a stamp in seconds on each line");
  if (times.size() != poses.size()) {
    throw InputError(times_path,
                     fmt::format("{} stamps for the {} poses of {}", times.size(), poses.size(), path),
                     "Give the times.txt of the same sequence.");
  }
  for (size_t i = 0; i < poses.size(); ++i) {
    poses[i].timestamp_s = times[i].values[0];
    if (i > 0 && poses[i].timestamp_s < poses[i - 1].timestamp_s) {
      throw InputError(fmt::format("{}:{}", times_path, times[i].line), "the stamp is before the one above",
                       "Give the times.txt of the same sequence.");
    }
  }
  return poses;
}

}  // namespace dynamic_slam
