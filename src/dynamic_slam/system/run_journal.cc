#include "dynamic_slam/system/run_journal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "dynamic_slam/base/error.h"
#include "dynamic_slam/base/text.h"

namespace dynamic_slam {
namespace {

// Before each line as frames.csv has it; all but map_was_erased are empty without a pose.
constexpr std::string_view kPoseColumns = "map_was_erased,part,tx,ty,tz,qx,qy,qz,qw,";
constexpr size_t kColumns = 9;

std::string Header() { return std::string(kPoseColumns) + FramesCsvHeader(); }

// Moves a journal that tells of frames out of the way; where to, or nothing.
std::filesystem::path Keep(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return {};
  const uintmax_t bytes = std::filesystem::file_size(file, error);
  if (error || bytes <= Header().size()) return {};
  std::filesystem::path kept;
  for (int i = 1; kept.empty() || std::filesystem::exists(kept); ++i) {
    kept = file.parent_path() / fmt::format("{}.{}.csv", file.stem().string(), i);
  }
  std::filesystem::rename(file, kept, error);
  if (error) {
    throw InputError(file.string(), fmt::format("of a killed run cannot be kept ({})", error.message()),
                     "Choose another folder with --out.");
  }
  return kept;
}

}  // namespace

RunJournal::RunJournal(std::filesystem::path folder)
    : file_(std::move(folder) / kFileName), kept_(Keep(file_)), stream_(file_) {
  stream_ << Header() << std::flush;
  if (!stream_) throw InputError(file_.string(), "cannot be written", "Choose another folder with --out.");
}

bool RunJournal::Add(const RunSummary::FrameRecord& record, std::string_view reason, PartId part,
                     const Rigid3& world_from_cam) {
  if (!stream_) return true;
  stream_ << (record.map_was_erased ? "1," : "0,");
  if (record.state == TrackingState::kTracking && part.IsValid()) {
    const Eigen::Vector3d& t = world_from_cam.translation;
    const Eigen::Quaterniond& q = world_from_cam.rotation;
    stream_ << fmt::format("{},{},{},{},{},{},{},{},", part.value(), t.x(), t.y(), t.z(), q.x(), q.y(), q.z(),
                           q.w());
  } else {
    stream_ << ",,,,,,,,";
  }
  // To the system, where it is safe from all but a loss of power.
  stream_ << FramesCsvRow(record, reason) << std::flush;
  return static_cast<bool>(stream_);
}

void RunJournal::Remove() {
  stream_.close();
  std::error_code ignored;
  std::filesystem::remove(file_, ignored);
}

RecoveredRun ReadJournal(const std::filesystem::path& folder_or_file) {
  const bool is_file = std::filesystem::is_regular_file(folder_or_file);
  const std::filesystem::path file = is_file ? folder_or_file : folder_or_file / RunJournal::kFileName;
  const std::string name = file.string();
  if (!std::filesystem::exists(file)) {
    throw InputError(
        name, "is not there",
        "Give the folder of results of a run that was killed; one that ended has all its results.");
  }
  const std::string text = ReadFile(file, "Give the folder of results of a run that was killed.");
  const auto refuse = [&name](size_t line) {
    throw InputError(fmt::format("{}:{}", name, line), "is no line of a journal",
                     "Remove the lines from there on, and try again.");
  };
  RecoveredRun run;
  run.frames_csv = FramesCsvHeader();
  std::map<uint32_t, Trajectory> parts;
  std::optional<uint32_t> last_part;
  size_t begin = 0;
  for (size_t line = 1;; ++line) {
    const size_t end = text.find('\n', begin);
    if (end == std::string::npos) break;
    std::string_view rest(text.data() + begin, end - begin);
    begin = end + 1;
    if (line == 1) {
      if (rest != Trim(Header())) refuse(line);
      continue;
    }
    std::array<std::string_view, kColumns + 1> columns;  // and the time stamp
    const std::string_view whole = rest;
    size_t row_at = 0;
    for (size_t i = 0; i < columns.size(); ++i) {
      const size_t comma = rest.find(',');
      if (comma == std::string_view::npos) refuse(line);
      if (i == kColumns) row_at = whole.size() - rest.size();
      columns[i] = rest.substr(0, comma);
      rest.remove_prefix(comma + 1);
    }
    if (columns[0] == "1" && last_part.has_value()) parts.erase(*last_part);
    if (!columns[1].empty()) {
      std::array<double, kColumns> values;  // part, pose, stamp
      for (size_t i = 0; i < values.size(); ++i) {
        const std::optional<double> value = ParseDouble(columns[i + 1]);
        if (!value.has_value() || !std::isfinite(*value)) refuse(line);
        values[i] = *value;
      }
      const Eigen::Quaterniond rotation(values[7], values[4], values[5], values[6]);
      if (values[0] < 0 || values[0] > 1e9 || std::abs(rotation.norm() - 1) > 1e-3) refuse(line);
      last_part = static_cast<uint32_t>(values[0]);
      parts[*last_part].push_back(
          {values[8], Rigid3(rotation.normalized(), Eigen::Vector3d(values[1], values[2], values[3]))});
    }
    run.frames_csv.append(whole.substr(row_at)).append("\n");
    ++run.frames;
  }
  if (text.empty()) refuse(1);
  for (auto& [part, trajectory] : parts) run.trajectories.push_back(std::move(trajectory));
  std::stable_sort(run.trajectories.begin(), run.trajectories.end(),
                   [](const Trajectory& a, const Trajectory& b) { return a.size() > b.size(); });
  return run;
}

}  // namespace dynamic_slam
