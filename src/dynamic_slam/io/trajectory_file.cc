#include "dynamic_slam/io/trajectory_file.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>

#include <Eigen/LU>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void Fail(const fs::path& file, int line, const std::string& reason, const std::string& remedy) {
  throw InputError(fmt::format("{}:{}", file.string(), line), reason, remedy);
}

// The line's columns as finite numbers.
std::vector<double> Numbers(const fs::path& file, const TextLine& line, size_t count,
                            const std::string& format) {
  const std::vector<std::string_view> columns = SplitColumns(line.text, ",");
  if (columns.size() != count) {
    Fail(file, line.number, fmt::format("{} columns, {} are wanted", columns.size(), count),
         fmt::format("A line is: {}", format));
  }
  std::vector<double> numbers;
  for (const std::string_view column : columns) {
    const std::optional<double> number = ParseDouble(column);
    if (!number) Fail(file, line.number, fmt::format("'{}' is not a number", column), "Correct the line.");
    if (!std::isfinite(*number))
      Fail(file, line.number, fmt::format("'{}' is not finite", column), "Drop the line.");
    numbers.push_back(*number);
  }
  return numbers;
}

void CheckOrder(const fs::path& file, int line, double previous, double stamp) {
  if (stamp >= previous) return;
  Fail(file, line, fmt::format("the stamp {:.9f} is before the one above, {:.9f}", stamp, previous),
       "Sort the lines by their stamp.");
}

void RequireLines(const fs::path& file, const std::vector<TextLine>& lines, const std::string& format) {
  if (lines.empty()) {
    throw InputError(file.string(), "holds no data", fmt::format("A line is: {}", format));
  }
}

const std::string kTumLine = "timestamp tx ty tz qx qy qz qw";
const std::string kKittiLine = "12 numbers, the rows of [R t]";
const std::string kTimesLine = "one stamp in seconds";

Trajectory StampedKittiPoses(const fs::path& poses_file, const fs::path& times_file) {
  const std::vector<double> times = ReadTimes(times_file);
  const std::vector<Rigid3> poses = ReadKittiPoses(poses_file);
  Trajectory trajectory;
  for (size_t i = 0; i < std::min(times.size(), poses.size()); ++i)
    trajectory.push_back({times[i], poses[i]});
  return trajectory;
}

}  // namespace

Trajectory ReadTumTrajectory(const fs::path& file) {
  const std::vector<TextLine> lines = ReadDataLines(file);
  RequireLines(file, lines, kTumLine);
  Trajectory trajectory;
  trajectory.reserve(lines.size());
  for (const TextLine& line : lines) {
    const std::vector<double> v = Numbers(file, line, 8, kTumLine);
    const Eigen::Quaterniond rotation(v[7], v[4], v[5], v[6]);
    if (std::abs(rotation.norm() - 1.0) > 0.01) {
      Fail(file, line.number, fmt::format("the quaternion's norm is {:.6g}, not 1", rotation.norm()),
           fmt::format("A line is: {}", kTumLine));
    }
    if (!trajectory.empty()) CheckOrder(file, line.number, trajectory.back().timestamp_s, v[0]);
    trajectory.push_back({v[0], Rigid3(rotation, Eigen::Vector3d(v[1], v[2], v[3]))});
  }
  return trajectory;
}

void WriteTumTrajectory(const fs::path& file, std::span<const StampedPose> trajectory) {
  std::string text = "# timestamp tx ty tz qx qy qz qw (world_from_cam)\n";
  for (const StampedPose& pose : trajectory) {
    const Eigen::Vector3d& t = pose.world_from_cam.translation;
    Eigen::Quaterniond q = pose.world_from_cam.rotation;
    if (q.w() < 0) q.coeffs() = -q.coeffs();  // one text for one rotation
    fmt::format_to(std::back_inserter(text), "{:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n",
                   pose.timestamp_s, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  WriteFileAtomically(file, text);
}

std::vector<KittiMatrix> ReadKittiMatrices(const fs::path& file) {
  const std::vector<TextLine> lines = ReadDataLines(file);
  RequireLines(file, lines, kKittiLine);
  std::vector<KittiMatrix> matrices;
  matrices.reserve(lines.size());
  for (const TextLine& line : lines) {
    const std::vector<double> v = Numbers(file, line, 12, kKittiLine);
    const KittiMatrix matrix = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(v.data());
    const Eigen::Matrix3d R = matrix.leftCols<3>();
    if ((R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() > 0.01 ||
        R.determinant() < 0) {
      Fail(file, line.number, "the first three columns are no rotation",
           fmt::format("A line is: {}", kKittiLine));
    }
    matrices.push_back(matrix);
  }
  return matrices;
}

std::vector<Rigid3> ReadKittiPoses(const fs::path& file) {
  std::vector<Rigid3> poses;
  for (const KittiMatrix& matrix : ReadKittiMatrices(file)) {
    poses.emplace_back(Eigen::Matrix3d(matrix.leftCols<3>()), Eigen::Vector3d(matrix.col(3)));
  }
  return poses;
}

void WriteKittiPoses(const fs::path& file, std::span<const Rigid3> world_from_cam) {
  std::string text;
  for (const Rigid3& pose : world_from_cam) {
    const Eigen::Matrix3d R = pose.Matrix();
    for (int row = 0; row < 3; ++row) {
      fmt::format_to(std::back_inserter(text), "{:.9f} {:.9f} {:.9f} {:.9f}{}", R(row, 0), R(row, 1),
                     R(row, 2), pose.translation[row], row < 2 ? ' ' : '\n');
    }
  }
  WriteFileAtomically(file, text);
}

std::vector<double> ReadTimes(const fs::path& file) {
  const std::vector<TextLine> lines = ReadDataLines(file);
  RequireLines(file, lines, kTimesLine);
  std::vector<double> times;
  times.reserve(lines.size());
  for (const TextLine& line : lines) {
    const double stamp = Numbers(file, line, 1, kTimesLine)[0];
    if (!times.empty()) CheckOrder(file, line.number, times.back(), stamp);
    times.push_back(stamp);
  }
  return times;
}

std::optional<Trajectory> LoadGroundTruth(const fs::path& source) {
  if (fs::is_regular_file(source / "groundtruth.txt")) return ReadTumTrajectory(source / "groundtruth.txt");
  // A trailing slash or a dot would hide the folder's name.
  std::error_code ignored;
  const fs::path sequence = fs::canonical(source, ignored);
  const fs::path poses_file =
      sequence.parent_path().parent_path() / "poses" / (sequence.filename().string() + ".txt");
  if (!fs::is_regular_file(sequence / "times.txt") || !fs::is_regular_file(poses_file)) return std::nullopt;
  return StampedKittiPoses(poses_file, sequence / "times.txt");
}

Trajectory ReadGroundTruth(const fs::path& file, const fs::path& source) {
  const std::vector<TextLine> lines = ReadDataLines(file);
  const bool is_kitti = !lines.empty() && SplitColumns(lines.front().text).size() == 12;
  if (!is_kitti) return ReadTumTrajectory(file);
  if (!fs::is_regular_file(source / "times.txt")) {
    throw InputError(file.string(), "has poses without stamps",
                     fmt::format("Put times.txt into {}, or give a file in TUM format.", source.string()));
  }
  return StampedKittiPoses(file, source / "times.txt");
}

}  // namespace dynamic_slam
